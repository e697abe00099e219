"""Make text from outside printable, for all that is shown on a terminal, on a page or in a report.

Names and header fields may hold what a terminal obeys (escape sequences, a carriage return), what reverses the text
around it (bidirectional overrides), what shows nothing (zero-width characters), and line breaks, after which a value
looks like a line of ours. Files for programs, such as JSON, keep the true text.
"""

from __future__ import annotations

from collections.abc import Iterable

# Letters and marks that show nothing: those of Unicode's Default_Ignorable_Code_Point that Python calls printable.
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
_INVISIBLE = frozenset(chr(code) for first, last in _INVISIBLE_RANGES for code in range(first, last + 1))


class PrintableText(str):
    """Text that is printable already, with line breaks of ours."""

    __slots__ = ()


def printable(text: str) -> PrintableText:
    r"""Return text from anywhere as one line, with Python's escapes for what is not printable: `\x1b`, `\n`, `\u202e`.

    Printable text is returned unchanged, as is that of `join_lines`. A byte of a file name that is not UTF-8 becomes
    that of its surrogate: `\udcff`.
    """
    if isinstance(text, PrintableText):
        return text
    if text.isascii() and text.isprintable():
        return PrintableText(text)
    return PrintableText("".join(char if _is_shown(char) else _escaped(char) for char in text))


def join_lines(lines: Iterable[str]) -> PrintableText:
    """Return lines, each made printable, as one text."""
    return PrintableText("\n".join(map(printable, lines)))


def _is_shown(char: str) -> bool:
    return char.isprintable() and char not in _INVISIBLE


def _escaped(char: str) -> str:
    return char.encode("unicode_escape").decode("ascii")
