"""Broken configurations: each is refused, or warned of, in words, with the line, and everything at once."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from compd.configuration.machine_configuration import Examined
from compd.errors import ConfigurationError, Problem, StateError
from compd.machine_check import examine_whole, load_whole
from compd.model_file import read_stored
from compd.recording import read_sidecar
from tests.support.paths import CONFIG

TRIPOD = (CONFIG / "tripod-cmm.yaml").read_text()

Edit = Callable[[str], str]


def swap(*pairs: tuple[str, str]) -> Edit:
    """The shipped tripod with the first occurrence of each text replaced."""

    def edit(text: str) -> str:
        for old, new in pairs:
            assert old in text, old
            text = text.replace(old, new, 1)
        return text

    return edit


def examined(tmp_path: Path, edit: Edit) -> Examined:
    path = tmp_path / "machine.yaml"
    path.write_text(edit(TRIPOD))
    return examine_whole(path)


# What is wrong with the text itself: one problem, since nothing after it can be judged.
UNREADABLE: dict[str, tuple[bytes, int, str]] = {
    "a list as a key": (b"a: 1\n? [a, b] : 1\n", 2, "a list or mapping is a key"),
    "a mapping as a key": (b"? {a: 1}\n: 2\n", 1, "a list or mapping is a key"),
    "a NUL byte": (b"a: 1\nb: \x00\n", 2, "U+0000"),
    "an escape character": (b"a: \x1b[31m\n", 1, "U+001B"),
    "five thousand brackets": (b"a: 1\nb: " + b"[" * 5000, 2, "more than 50 levels"),
    "brackets that close": (b"b: " + b"[" * 5000 + b"]" * 5000, 1, "more than 50 levels"),
    "a list within itself": (b"a: 1\nx: &x [*x]\n", 2, "recursive alias"),
    "a mapping within itself": (b"x: &x\n  y: *x\n", 2, "recursive alias"),
    "aliases of aliases": (
        b"a0: &a0 [x, x, x, x, x, x, x, x, x]\n"
        + b"".join(b"a%d: &a%d [%s]\n" % (i, i, b", ".join([b"*a%d" % (i - 1)] * 9)) for i in range(1, 10)),
        6,
        "aliases unfolded",
    ),
    "merged aliases of aliases": (
        b"a0: &a0 {x: 1}\n"
        + b"".join(b"a%d: &a%d {<<: [*a%d, *a%d, *a%d]}\n" % (i, i, i - 1, i - 1, i - 1) for i in range(1, 40)),
        11,
        "aliases unfolded",
    ),
    "Latin-1": ("a: 1\nname: Glück\n".encode("latin-1"), 2, "save the file as UTF-8"),
    "UTF-16": ("a: 1\n".encode("utf-16"), 1, "save the file as UTF-8"),
    "a tab": (b"a:\n\tb: 1\n", 2, "indent with spaces"),
    "two documents": (b"a: 1\n---\nb: 2\n", 2, "another document"),
    "an alias of nothing": (b"a: 1\nb: *c\n", 2, "undefined alias"),
    "a quote that does not end": (b'a: "abc\nb: 3\n', 3, "end of stream"),
    "a python object": (b"a: !!python/object/apply:os.system [ls]\n", 1, "tags are not used here"),
    "a tag of one's own": (b"a: 1\nb: !degC 3\n", 2, "tags are not used here"),
    "a tag that does not fit": (b"a: !!int abc\n", 1, "cannot be read as int"),
    "a number of 5000 digits": (b"a: " + b"9" * 5000 + b"\n", 1, "cannot be read as int"),
    "half a surrogate": (b'a: "\\ud800"\n', 1, "Unicode"),
    "nothing to merge": (b"a: 1\nb: {<<: 5}\n", 2, "nothing that can be merged"),
    "a key given twice": (b"a: 1\nb: 2\na: 3\n", 3, "given twice, first in line 1"),
}


@pytest.mark.parametrize(("content", "line", "words"), UNREADABLE.values(), ids=UNREADABLE)
def test_a_text_that_is_no_configuration_is_refused_with_its_line(
    tmp_path: Path, content: bytes, line: int, words: str
) -> None:
    path = tmp_path / "machine.yaml"
    path.write_bytes(content)
    with pytest.raises(ConfigurationError) as caught:
        examine_whole(path)
    (problem,) = caught.value.problems
    assert problem.where.startswith(f"{path}:{line}")
    assert words in str(problem)


@pytest.mark.parametrize(
    ("path", "words"),
    [("/dev/zero", "not a regular file"), ("/tmp", "directory"), ("/nowhere/machine.yaml", "No such file")],
)
def test_what_is_no_file_is_refused(path: str, words: str) -> None:
    with pytest.raises(ConfigurationError, match=words):
        examine_whole(Path(path))


# Edits of a good file, and what must be said: (key, words), all in one go.
PROBLEMS: dict[str, tuple[Edit, list[tuple[str, str]]]] = {
    "several problems of one list": (
        swap(
            ("{link: 1, gauge: scale_1}", "{link: 1, gauge: scale_1, sign: 2}"),
            ("{link: 2, gauge: scale_2}", '{link: 2, gauge: scale_2, sign: "-"}'),
            ("{link: 3, gauge: scale_3}", "{link: 4, gauge: scale_3}"),
        ),
        [
            ("wiring.scale[1].sign", "1 or -1"),
            ("wiring.scale[2].sign", "1 or -1"),
            ("wiring.scale[3].link", "no such link"),
            ("wiring.scale", "link 3 has 0 scales"),
        ],
    ),
    "fields and conventions of the geometry": (
        swap(("weight_N: 80", "weight_N: heavy"), ("[0, 250, 0]", "[0, 251, 0]"), ("[330, 660]", "[660, 330]")),
        [
            ("geometry.platform.weight_N", "must be a number"),
            ("geometry.base.supports_B_mm", "centroid"),
            ("geometry.link_length_mm", "shortest length first"),
        ],
    ),
    "a line and the gauges beside it": (
        swap(("baud: 38400", "baud: fast"), ("line: joints", "line: joint"), ("heads: 9", "heads: 99")),
        [
            ("lines.scale_1.baud", "whole number"),
            ("gauges.joints.line", "no such line"),
            ("gauges.joints.heads", "15"),
        ],
    ),
    "empty sections": (
        lambda _: "machine:\ngeometry:\nlines:\nwiring:\nloop:\nlimits:\nsockets:\nstate:\ngauges:\n",
        [(name, "must be") for name in ("machine", "geometry", "lines", "wiring", "loop", "limits", "sockets")]
        + [("gauges", "missing or empty")],
    ),
    "lists for sections": (
        lambda _: "machine: []\ngeometry: []\nlines: []\nwiring: []\nloop: []\nlimits: 3\nsockets: x\nstate: []\n",
        [(name, "must be") for name in ("machine", "geometry", "lines", "wiring", "loop", "limits", "sockets")],
    ),
    "a base in metres": (
        swap(("[0, 0, 700]", "[0, 0, 0.7]")),
        [("geometry.base.origin_B0_in_M_mm", "in metres?")],
    ),
    "two joints in one place": (
        swap(("- [-69.282032302755, -40, 0]", "- [0, 80, 0]")),
        [("geometry.platform.joints_P_mm[2]", "same point as entry 1")],
    ),
    "plate points in line": (
        swap(("- [0, -350, 0]", "- [0, 175, 0]")),
        [("geometry.plate_points_M_mm", "on one line")],
    ),
    "plate points in the other order": (
        swap(
            (
                "    - [-303.108891324554, 175, 0]\n    - [0, -350, 0]",
                "    - [0, -350, 0]\n    - [-303.108891324554, 175, 0]",
            )
        ),
        [("geometry.plate_points_M_mm", "frame at machine zero")],
    ),
    "a hexapod with three links": (
        swap(("tripod_3spr", "hexapod_6ups")),
        [
            ("geometry.base.joints_B_mm", "needs 6"),
            ("geometry.platform.revolute_axes_P", "needs 0"),
            ("wiring.scale", "link 4 has 0 scales"),
        ],
    ),
    "too few coordinates": (swap(("[0, 0, 190]", "[0, 190]")), [("geometry.tool.zero_tip_M_mm", "too few")]),
    "a tool on the table": (swap(("on: platform ", "on: table ")), [("geometry.tool", "'platform', 'plate'")]),
    "an axis of no length": (swap(("[-1, 0, 0]", "[0, 0, 0]")), [("revolute_axes_P[1]", "must have length 1")]),
    "a decimal comma": (
        swap(("correction_mm: 0.2", "correction_mm: 0,2")),
        [("limits.correction_mm", "write 0.2, with a point")],
    ),
    "infinity by its exponent": (swap(("rate_hz: 200", "rate_hz: 1e400")), [("loop.rate_hz", "finite")]),
    "a NUL in a port": (swap(("/dev/serial/by-id/usb-joints", '"/dev/\\0"')), [("lines.joints.port", "printable")]),
    "a NUL in a socket": (swap(("/run/compd/compd.sock", '"/run/\\0"')), [("sockets.unix.path", "printable")]),
    "a socket that is a file": (swap(("/run/compd/compd.sock", "/etc/passwd")), [("sockets.unix.path", "no socket")]),
    "a socket below a file": (
        swap(("/run/compd/compd.sock", "/etc/passwd/compd.sock")),
        [("sockets.unix.path", "no directory")],
    ),
    "a state directory of the kernel": (
        swap(("directory: /var/lib/compd", "directory: /proc/1/nowhere")),
        [("state.directory", "there can be no such directory")],
    ),
    "a model file that is not there": (
        swap(("  directory: /var/lib/compd", "  model_file: /nowhere/m.yaml\n  directory: /var/lib/compd")),
        [("state.model_file", "there is no such file")],
    ),
    "a host that is a sentence": (swap(("host: 127.0.0.1", "host: my host")), [("sockets.tcp.host", "address")]),
    "numbers as names": (
        swap(("  scale_1: {driver", "  1: {driver"), ("  joints:   ", "  5:   ")),
        [
            ("gauges.1", "cannot be a gauge's name"),
            ("lines.5", "write it in quotes"),
            ("gauges.joints.line", "no such"),
        ],
    ),
    "a driver that is a number": (swap(("driver: modbus", "driver: 5")), [("gauges.frame_u", "needs `driver:`")]),
    "a gauge that is a list": (
        swap(("{driver: heidenhain_nd28x, line: scale_1, acceleration_mm_per_s2: 300, noise_um: 0.03}", "[a]")),
        [("gauges.scale_1", "needs `driver:`")],
    ),
    "one scale for two links": (
        swap(("{link: 3, gauge: scale_3}", "{link: 3, gauge: scale_1}")),
        [("wiring.scale[3].gauge", "wired already")],
    ),
    "an open port without a list of who may connect": (
        swap(("host: 127.0.0.1, port", "host: 0.0.0.0, port")),
        [("sockets.tcp", "allow and token_file are missing")],
    ),
    "a machine called external": (
        swap(("machine: tripod-cmm", "machine: external")),
        [("geometry.platform", "unknown key")],
    ),
    "a machine without a name": (swap(("machine: tripod-cmm", 'machine: ""')), [("machine", "must not be empty")]),
    "a name with a colour": (swap(("machine: tripod-cmm", 'machine: "\\e[31m"')), [("machine", "printable")]),
    "a huge number": (swap(("[0, 0, 700]", "[0, 0, 1e300]")), [("geometry", "NOT_FINITE")]),
    "a quantity without a unit": (
        swap(("temperature_room_degC", "temperature_room")),
        [("wiring.quantities[1].name", "temperature_room_degC")],
    ),
}


@pytest.mark.parametrize(("edit", "said"), PROBLEMS.values(), ids=PROBLEMS)
def test_everything_that_is_wrong_is_said_at_once_with_its_line(
    tmp_path: Path, edit: Edit, said: list[tuple[str, str]]
) -> None:
    found = examined(tmp_path, edit)
    assert found.configuration is None
    problems = [(problem.where, str(problem)) for problem in found.problems]
    for key, words in said:
        assert any(key in where and words in text for where, text in problems), (key, words, problems)
    lines = [where.rpartition("machine.yaml:")[2].partition(" ")[0] for where, _ in problems if ":" in where]
    assert lines == sorted(lines, key=lambda line: int(line) if line.isdigit() else 0)


WARNINGS: dict[str, tuple[Edit, list[tuple[str, str]]]] = {
    "numbers that stop nothing": (
        swap(
            ("correction_mm: 0.2", "correction_mm: 200"),
            ("slew_mm_per_s: 0.5", "slew_mm_per_s: 5000"),
            ("valid_for_s: 0.1", "valid_for_s: 1000"),
            ("stale_after_s: 0.5", "stale_after_s: 500"),
            ("hold_s: 5", "hold_s: 5000"),
        ),
        [
            ("limits.correction_mm", "200 mm"),
            ("limits.slew_mm_per_s", "stop no jump"),
            ("sockets.valid_for_s", "a dead daemon"),
            ("loop.stale_after_s", "still counts as good"),
            ("loop.hold_s", "5000 s"),
        ],
    ),
    "a stroke in metres": (
        swap(("[330, 660]", "[0.33, 0.66]")),
        [
            ("geometry.link_length_mm[1]", "in metres? then write 330"),
            ("geometry.link_length_mm", "cannot be as long as at machine zero, 481.0"),
        ],
    ),
    "a stroke without machine zero": (
        swap(("[330, 660]", "[500, 660]")),
        [("geometry.link_length_mm", "targets will be refused")],
    ),
    "a gauge's own times": (
        swap(("noise_um: 0.035\n    heads: 9", "heads: 9\n    stale_after_s: 5000\n    noise_um: 500")),
        [("gauges.joints.stale_after_s", "5000 s"), ("gauges.joints.noise_um", "corrects nothing")],
    ),
    "a setpoint shorter than a period": (
        swap(("valid_for_s: 0.1", "valid_for_s: 0.004")),
        [("sockets.valid_for_s", "before the next one comes")],
    ),
    "waits in the wrong order": (
        swap(("timeout_s: 0.2\n", "timeout_s: 0.2\n    back_off_s: [10, 1]\n")),
        [("lines.joints.back_off_s", "first wait is the longest")],
    ),
    "an open port": (
        swap(("host: 127.0.0.1, port", "host: 0.0.0.0, allow: [10.0.0.0/8], token_file: /etc/compd/token, port")),
        [("sockets.tcp.host", "OPEN TO THE NETWORK")],
    ),
}


@pytest.mark.parametrize(("edit", "said"), WARNINGS.values(), ids=WARNINGS)
def test_what_is_probably_a_mistake_is_warned_of_with_its_line(
    tmp_path: Path, edit: Edit, said: list[tuple[str, str]]
) -> None:
    found = examined(tmp_path, edit)
    assert found.configuration is not None, found.problems
    warnings = [(warning.where, str(warning)) for warning in found.configuration.warnings]
    for key, words in said:
        assert any(where.endswith(key) and words in text for where, text in warnings), (key, words, warnings)
    assert all("machine.yaml:" in where for where, _ in warnings)


def test_a_directory_that_this_user_cannot_write_is_warned_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("compd.configuration.places.os.access", lambda *_: False)
    state = tmp_path / "state" / "compd"
    found = examined(tmp_path, swap(("directory: /var/lib/compd", f"directory: {state}")))
    (warning,) = found.warnings
    assert "state.directory" in warning.where
    assert f"does not exist, and {tmp_path} cannot be written" in warning.what


MERGED = """
    scale_1: &display
      kind: serial
      port: /dev/serial/by-id/usb-scale-1
      baud: 38400
      format: "7E2"
      timeout_s: 0.15
    scale_2:
      <<: *display
      port: /dev/serial/by-id/usb-scale-2
    scale_3: {<<: [*display, {low_latency: false}], port: /dev/serial/by-id/usb-scale-3}
"""


def merged_lines(text: str) -> str:
    head, _, rest = text.partition("  scale_1:   ")
    _, _, tail = rest.partition("  joints:   ")
    return head + MERGED.replace("\n    ", "\n  ").lstrip("\n") + "  joints:   " + tail


def test_merge_keys_work_also_in_lists(tmp_path: Path) -> None:
    found = examined(tmp_path, merged_lines)
    assert found.configuration is not None, found.problems
    lines = found.configuration.lines
    assert [getattr(lines[f"scale_{k}"], "baud", None) for k in (1, 2, 3)] == [38400] * 3
    assert [getattr(lines[f"scale_{k}"], "low_latency", None) for k in (1, 2, 3)] == [None, None, False]
    assert getattr(lines["scale_3"], "port", "").endswith("usb-scale-3")


def test_a_mistake_in_what_is_merged_has_the_line_of_the_anchor(tmp_path: Path) -> None:
    found = examined(
        tmp_path,
        lambda text: (
            merged_lines(text)
            .replace("      baud: 38400", "      baud: fast", 1)
            .replace("    baud: 38400", "    baud: fast", 1)
        ),
    )
    text = (tmp_path / "machine.yaml").read_text().splitlines()
    line = next(number for number, content in enumerate(text, start=1) if "baud: fast" in content)
    places = [problem.where for problem in found.problems]
    assert places == [f"{tmp_path / 'machine.yaml'}:{line} lines.scale_{k}.baud" for k in (1, 2, 3)]


def test_scalars_are_those_of_yaml_1_2(tmp_path: Path) -> None:
    found = examined(tmp_path, swap(("rate_hz: 200", "rate_hz: 0100"), ("machine: tripod-cmm", "machine: on")))
    assert found.configuration is not None
    assert (found.configuration.machine, found.configuration.loop.rate_hz) == ("on", 100)


def test_run_reads_the_configuration_by_the_same_code(tmp_path: Path) -> None:
    found = examined(tmp_path, swap(("[0, 0, 700]", "[0, 0, 0.7]"), ("rate_hz: 200", "rate_hz: fast")))
    with pytest.raises(ConfigurationError) as caught:
        load_whole(tmp_path / "machine.yaml")
    assert list(caught.value.problems) == found.problems
    assert len(found.problems) == 2


@pytest.mark.parametrize(("content", "line", "words"), UNREADABLE.values(), ids=UNREADABLE)
def test_model_files_and_sidecars_are_read_by_the_same_code(
    tmp_path: Path, content: bytes, line: int, words: str
) -> None:
    path = tmp_path / "run.yaml"
    path.write_bytes(content)
    with pytest.raises(StateError) as caught:
        read_stored(path)
    problems: list[Problem] = []
    assert read_sidecar(path, problems) is None
    for (problem,) in (caught.value.problems, problems):
        assert problem.where.startswith(f"{path}:{line}")
        assert words in str(problem)
