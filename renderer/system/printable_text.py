"""Make text from outside printable, before it is shown on a terminal, on a page or in a report.

Names and header fields may hold commands to a terminal (escape sequences, a carriage return), characters that reverse
the text around them (bidirectional overrides), invisible characters (of width zero), and line breaks, after which a
value looks like a message of hsplat. Files for programs, such as JSON, keep the true text.
"""

from __future__ import annotations

from collections.abc import Iterable

# The ranges of invisible letters and marks: the characters of Unicode's Default_Ignorable_Code_Point that Python calls
# printable.
_INVISIBLE_RANGES = (
    (0x034F, 0x034F),
    (0x115F, 0x1160),
    (0x17B4, 0x17B5),
    (0x180B, 0x180F),
    (0x3164, 0x3164),
    (0xFE00, 0xFE0F),
    (0xFFA0, 0xFFA0),
    (0xE0100, 0xE01EF),
)
# The invisible letters and marks that Python calls printable.
_INVISIBLE = frozenset(chr(code) for first, last in _INVISIBLE_RANGES for code in range(first, last + 1))


class PrintableText(str):
    """A text that has been made printable. If it has line breaks, they come from `join_lines`."""

    __slots__ = ()


def printable(text: str) -> PrintableText:
    r"""Return a text as one line, with Python's escapes for unprintable characters: `\x1b`, `\n`, `\u202e`.

    Printable text, and the text of `join_lines`, is returned unchanged. A byte of a file name that is not UTF-8 becomes
    the escape of its surrogate, such as `\udcff`.
    """
    if isinstance(text, PrintableText):
        return text
    if text.isascii() and text.isprintable():
        return PrintableText(text)
    return PrintableText("".join(char if _is_shown(char) else _escaped(char) for char in text))


def join_lines(lines: Iterable[str]) -> PrintableText:
    """Return one text of several lines, each of which is made printable."""
    return PrintableText("\n".join(map(printable, lines)))


def _is_shown(char: str) -> bool:
    return char.isprintable() and char not in _INVISIBLE


def _escaped(char: str) -> str:
    return char.encode("unicode_escape").decode("ascii")
