"""Calibration of a machine from its drawing and recordings of poses."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from compd.api.arguments import Recorded, opened_recording
from compd.calibration import Calibration
from compd.calibration import calibrate as calibrate_aligned
from compd.comparison import AlignedRecording


def calibrate(
    recordings: Recorded | Sequence[Recorded],
    sealed: Recorded | Sequence[Recorded] = (),
    *,
    blocks: Sequence[str] = (),
    progress: Callable[[str], None] | None = None,
) -> Calibration:
    """Learn how a machine is built, from its drawing and recordings of poses at rest.

    Joints, lengths, zeros, gains, directions and the tip, as far as the machine has them, are fitted together, each
    with the machine's tolerance as prior. A block of them is taken where poses that were left out, at random and whole
    regions, are predicted better with it.

    Parameters
    ----------
    recordings : AlignedRecording, str, Path or sequence of these
        What to learn from, as `open_recording` returns it, or paths of recordings whose machine comes with compd. Each
        has its own instrument, frame and noise; all are of one machine.
    sealed : AlignedRecording, str, Path or sequence of these
        Recordings that are looked at last, for a test of the result.
    blocks : sequence of str
        Ids of the effects whose numbers may be taken, such as ``"link_zero"``; left out, all of the drawing.
    progress : callable, optional
        Called with a text as each step begins.

    Returns
    -------
    Calibration
        Each number with its drawing, value and standard error; errors of poses left out; what the poses cannot tell.

    Raises
    ------
    CompdError
        Where the recordings are of different machines or of an external model, or hold too few poses.
    RecordingError, ConfigurationError
        As `open_recording` does.

    Examples
    --------
    >>> import compd
    >>> monday = compd.open_recording("monday.csv", "hexapod.yaml")
    >>> calibration = compd.calibrate(monday)
    >>> calibration.held_out[0].after_rms_um  # error of poses that were left out, um per coordinate
    5.1
    """
    return calibrate_aligned(_opened(recordings), _opened(sealed), progress, blocks)


def _opened(recordings: Recorded | Sequence[Recorded]) -> list[AlignedRecording]:
    if isinstance(recordings, Sequence) and not isinstance(recordings, str):
        return [opened_recording(one) for one in recordings]
    return [opened_recording(recordings)]
