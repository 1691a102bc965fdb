"""JSON has neither NaN nor spaces."""

from __future__ import annotations

import math
from collections import OrderedDict

import numpy as np
import pytest

from compd.text.json_text import encode_compact, nan_to_null, omit_unknown


def test_nan_becomes_null_and_every_key_stays() -> None:
    report = {"a": math.nan, "b": [1.5, -math.inf, {"c": np.float64("nan")}], "d": "nan", "e": 3, "f": None}
    assert nan_to_null(report) == {"a": None, "b": [1.5, None, {"c": None}], "d": "nan", "e": 3, "f": None}
    assert type(nan_to_null(np.float64(0.5))) is float


def test_what_is_not_known_is_left_out_of_a_message() -> None:
    message = OrderedDict(a=math.inf, b=(1.0, math.nan), c={"d": None, 5: 0.5}, e="")
    assert omit_unknown(message) == {"b": [1.0, None], "c": {"5": 0.5}, "e": ""}


def test_compact_json_has_no_spaces_and_refuses_nan() -> None:
    assert encode_compact({"a": [1, 2.5], "b": None}) == '{"a":[1,2.5],"b":null}'
    with pytest.raises(ValueError, match="Out of range"):
        encode_compact([math.nan])
