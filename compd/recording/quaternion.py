"""An attitude that was measured as a quaternion, as the rotation vector that the format has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from compd.columns import (
    ATTITUDE_COLUMNS,
    COMMANDED_ATTITUDE_COLUMNS,
    COMMANDED_QUATERNION_COLUMNS,
    QUATERNION_COLUMNS,
)
from compd.tables import ProblemList, Table, rows_text

# Instruments write four to eight decimals: a length that is off by more has another reason.
MAX_OFF_LENGTH = 1e-3
_FORMS = ((QUATERNION_COLUMNS, ATTITUDE_COLUMNS), (COMMANDED_QUATERNION_COLUMNS, COMMANDED_ATTITUDE_COLUMNS))


def with_rotation_vectors(table: Table, problems: ProblemList) -> Table:
    """The table with `reference_rx_rad` ... in the place of `reference_qx` ..., and so of the commanded attitude; q and
    -q are one attitude.

    Every contradiction goes to `problems`: some of the four columns, both forms, a quaternion that is not of length 1.
    """
    for quaternion, vector in _FORMS:
        table = _with_rotation_vector(table, quaternion, vector, problems)
    return table


def _with_rotation_vector(
    table: Table, quaternion_columns: tuple[str, ...], vector_columns: tuple[str, ...], problems: ProblemList
) -> Table:
    present = [name for name in quaternion_columns if name in table.letters]
    if not present:
        return table
    own = {name: letters for name, letters in table.letters.items() if name not in quaternion_columns}
    if doubled := [name for name in vector_columns if name in own]:
        what = f"{', '.join([*present, *doubled])}: the attitude twice"
        problems.add("", what, allowed="a rotation vector or a quaternion", next_step="delete one of the two")
    elif missing := [name for name in quaternion_columns if name not in present]:
        what = f"the column{'s are' if len(missing) > 1 else ' is'} missing: {', '.join(missing)}"
        problems.add("", what, allowed=", ".join(quaternion_columns), next_step="add all four, the scalar last")
    columns = {name: values for name, values in table.columns.items() if name not in quaternion_columns}
    if doubled or missing or not set(quaternion_columns) <= set(table.columns):
        return replace(table, letters=own, columns=columns)
    quaternion = np.stack([table.columns[name] for name in quaternion_columns], axis=1)
    length = np.sqrt((quaternion * quaternion).sum(axis=1))
    known = np.isfinite(length)
    wrong = known & (np.abs(length - 1.0) > MAX_OFF_LENGTH)
    if wrong.any():
        problems.add(
            f"columns {', '.join(quaternion_columns)}, {rows_text(table.row[wrong].tolist())}",
            "no quaternion of a rotation: its length is not 1",
            f"{length[wrong][0]:.6g}",
            f"1 within {MAX_OFF_LENGTH:g}",
            "give qx, qy, qz, qw as the instrument exports them, the scalar last",
        )
    vector = np.full((len(quaternion), 3), np.nan)
    turned = known & (length > 0)
    vector[turned] = Rotation.from_quat(quaternion[turned]).as_rotvec()
    letters = table.letters[quaternion_columns[0]]
    return replace(
        table,
        letters={**own, **dict.fromkeys(vector_columns, letters)},
        columns={**columns, **dict(zip(vector_columns, vector.T, strict=True))},
    )
