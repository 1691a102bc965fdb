"""Files that a person, an editor or a bad disk has changed."""

from __future__ import annotations

from collections.abc import Sequence

from hypothesis import strategies as st

# Values that a person or a program writes where a number or a name should be.
ODD_VALUES = (
    "", "null", "~", "true", "on", "-1", "0", "1e999", "-1e-320", ".nan", ".inf", "1e30",
    "123456789012345678901234567890",
    "[]", "{}", "[[[[]]]]", "!!python/object/apply:os.system [id]", "!!binary aGk=", "*a", "&a 1", "<<", "'", '"',
    "|", ">",
    "%", "@", "`", "?", "? [a, b] : 1", "\t", "\x00", "\u2028", "é", "\ud7ff", "2026-11-22", "0x10", "0o7", "1_000",
    "12:30:45", "NaN", "no", "a" * 5000, "../../etc/passwd", "/dev/zero", "- - - -", "x: y: z", "#", "---", "...",
)  # fmt: skip
# Nine lines that are half a million entries where aliases are followed.
ALIASES = "a: &a [x,x,x,x,x,x,x,x,x]\n" + "".join(
    f"{name}: &{name} [{','.join(['*' + before] * 9)}]\n" for before, name in zip("abcde", "bcdef", strict=True)
)
# Whole files that break parsers.
BOMBS = (
    "", "\x00", "[" * 5000, "{" * 5000, "? [a, b] : 1", "x: &x [*x]", "a: &a {<<: *a}", "- " * 3000,
    "%YAML 9.9\n---\na: 1", "\ufeffmachine: x", "machine: caf\udce9", "a: !!set {b, c}", "key: |\n" + "x\n" * 20000,
    "a: 'unclosed", 'a: "unclosed', "a: b: c", "\t\tmachine: x", "? ? ? a", "--- a\n--- b", "!", "&", "*",
)  # fmt: skip


@st.composite
def changed_binary(draw: st.DrawFn, original: bytes) -> bytes:
    """The bytes after up to six of them were changed, most often near the end, perhaps cut off."""
    content = bytearray(original)
    for _ in range(draw(st.integers(1, 6))):
        end = draw(st.sampled_from([len(content), min(2000, len(content))]))
        content[-draw(st.integers(1, end))] = draw(st.integers(0, 255))
    return bytes(content[: draw(st.just(len(content)) | st.integers(0, len(content)))])


@st.composite
def changed_text(draw: st.DrawFn, originals: Sequence[str]) -> str:
    """One of the texts after up to six changes of lines and characters."""
    lines = draw(st.sampled_from(originals)).split("\n")
    for _ in range(draw(st.integers(1, 6))):
        at = draw(st.integers(0, max(0, len(lines) - 1)))
        line = lines[at] if lines else ""
        head, colon, _ = line.partition(":")
        odd = st.one_of(st.sampled_from(ODD_VALUES), st.text(max_size=12), st.floats().map(str))
        match draw(st.integers(0, 8)):
            case 0:
                lines[at : at + 1] = []
            case 1:
                lines[at:at] = [line]
            case 2:
                lines[at : at + 1] = [" " * draw(st.integers(0, 12)) + line.strip()]
            case 3:
                lines[at : at + 1] = [f"{head}{colon} {draw(odd)}"]
            case 4:
                lines[at:at] = [draw(odd)]
            case 5:
                place = draw(st.integers(0, len(line)))
                lines[at : at + 1] = [line[:place] + draw(st.text(max_size=3)) + line[place + 1 :]]
            case 6:
                other = draw(st.integers(0, max(0, len(lines) - 1)))
                lines[at : at + 1], lines[other : other + 1] = lines[other : other + 1], lines[at : at + 1]
            case 7:
                del lines[at + draw(st.integers(0, 40)) :]
            case 8:
                cells = line.split(",")
                cells[draw(st.integers(0, len(cells) - 1))] = draw(odd)
                lines[at : at + 1] = [",".join(cells)]
    return "\n".join(lines)


def changed_bytes(originals: Sequence[str]) -> st.SearchStrategy[bytes]:
    """Changed texts as files: UTF-8, another encoding, cut in the middle of a character, or turned bits."""
    text = changed_text(originals) | st.sampled_from(BOMBS)
    return st.one_of(
        text.map(lambda text: text.encode("utf-8", "surrogateescape")),
        text.map(lambda text: text.encode("latin-1", "replace")),
        text.map(lambda text: text.encode("utf-16", "surrogatepass")),
        st.tuples(text, st.integers(0, 10**6), st.integers(0, 255)).map(_with_byte),
    )


def _with_byte(drawn: tuple[str, int, int]) -> bytes:
    text, place, byte = drawn
    data = bytearray(text.encode("utf-8", "surrogateescape"))
    if data:
        data[place % len(data)] = byte
    return bytes(data)
