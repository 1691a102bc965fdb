"""Whether the daemon says that it starts with the applied model again."""

from __future__ import annotations

from pathlib import Path

import pytest

from compd.live.service.model_keeping import ModelKeeping

MACHINE = Path("/etc/compd/machine.yaml")


@pytest.mark.parametrize(
    ("starts_with", "applied", "says"),
    [
        ("/etc/compd/m.yaml", "/etc/compd/m.yaml", "kept over a restart"),
        (None, None, "kept over a restart"),
        (None, "/tmp/m.yaml", "write `model_file: /tmp/m.yaml` under `state:` in /etc/compd/machine.yaml"),
        ("/etc/compd/m.yaml", "/tmp/m.yaml", "write `model_file: /tmp/m.yaml`"),
        ("/etc/compd/m.yaml", None, "remove `model_file: /etc/compd/m.yaml`"),
    ],
)
def test_what_keeps_the_model(starts_with, applied, says):
    models = {"applied": {"effects": [], **({"file": applied} if applied else {})}}
    keys = ModelKeeping(MACHINE, starts_with).keys(models)
    assert keys["kept"] == (starts_with == applied)
    assert says in keys["kept_text"]
    assert ("not kept" in keys["kept_text"]) == (not keys["kept"])
