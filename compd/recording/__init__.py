"""A recording: raw readings of a machine beside an external reference, as files and as arrays.

On disk a recording is NAME.csv (one row per instant, a header, `.` decimal, UTF-8) beside NAME.yaml, the sidecar.

| column | meaning |
|---|---|
| `time_s` | seconds from the start; rising |
| `session` | optional integer: an independent measuring session, which cross-validation leaves out as a whole |
| `visit` | optional integer: rows of one visit are immediate repeats; their scatter is the noise floor |
| `point` | optional id of the nominal target |
| `scale_<i>_mm` | linear scale of link i, zero at machine zero |
| `joint_<k>_um` | joint comparator k, zero at machine zero |
| `frame_t<k>_um`, `frame_u<k>_um` | frame comparators: change of t_k, u_k since machine zero |
| `approach_<i>` | optional +1/-1: the direction in which link i last moved; without it, from the scales |
| `temperature_<place>_degC`, `force_x_N`, ..., `<name>_<unit>` | quantities |
| `reference_x_mm`, `_y_`, `_z_` | the tip in {M}, or in the instrument's frame; any subset of axes |
| `reference_rx_rad`, `_ry_`, `_rz_` | optional attitude: rotation vector of {P} in {M} |
| `reference_link_<i>_mm` | instead: the change of link i by interferometer |
| `ball` | instead: the number of a ball on a calibrated plate |
| `model_...` | with `machine: external`: the prediction of the user's own model, column for column |

An empty cell is a missing value. The sidecar:

    format: 2                        # without it: 1, of release 0.1
    machine: tripod-cmm              # a machine configuration, or `external`
    reference:
      quantity: tool_position        # tool_pose, link_length, ball_plate
      frame: machine                 # or `instrument`: then six registration parameters are always fitted
      sigma_um: 0.15                 # standard uncertainty per axis, or one for each axis; optional
      balls: plate-17.csv            # ball_plate only: ball, x_mm, y_mm, z_mm
    excluded_rows:                   # by a person, with the reason
    - {row: 17, reason: the tracker's beam was cut}
    provenance: {}                   # how the recording came to be
    notes: text

Module `columns` has the names, units and decimals, `sidecar` the YAML; `writer` writes both files, `reader` reads and
checks them.
"""
