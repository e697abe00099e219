"""Run `hsplat man`: print the manual page, which is made of the help of all commands."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import click

from hsplat_cli.terminal import Reporter
from renderer.system import join_lines, package_versions

# The exit codes of all commands.
_EXIT_CODES = [
    ("0", "The work is done."),
    ("1", "The render failed, a comparison found a difference, or films cannot be drawn here."),
    ("2", "The input was wrong, or a comparison could not be made."),
    ("128 + n", "The signal n ended the command: 130 is Ctrl-C."),
]
# The variables of the environment that users set.
_VARIABLES = [
    ("LP_NUM_THREADS", "The number of threads, in place of the number of processors."),
    ("TMPDIR", "The folder of temporary files, such as decoded volumes."),
    ("IMAGEIO_FFMPEG_EXE", "The path of another ffmpeg."),
    ("HSPLAT_DEBUG", "With the value 1, an unexpected error has a traceback."),
]
# The largest number of characters of a line of text in roff source; escapes make some lines longer.
_WIDTH = 70
# The escapes of characters that have a meaning in roff.
_ESCAPES = {"\\": "\\e", "-": "\\-", "'": "\\(aq", "`": "\\(ga", '"': "\\(dq"}


class RoffFormatter(click.HelpFormatter):
    """Collects the help of commands as the lines of a manual page.

    lines: the lines so far. is_below: whether the help is of a command below `hsplat`, without headings of its own.
    """

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []
        self.is_below = False

    def write_usage(self, prog: str, args: str = "", prefix: str | None = None) -> None:
        """Write the line that says how the command is called."""
        if self.is_below:
            self.lines.append(f'.SS "{_roff(prog)} {_roff(args)}"')
        else:
            self.lines += [".SH SYNOPSIS", f"\\fB{_roff(prog)}\\fR {_roff(args)}"]

    def write_heading(self, heading: str) -> None:
        """Write the heading of a section."""
        self.lines += [] if self.is_below else [f".SH {_roff(heading).upper()}"]

    def write_paragraph(self) -> None:
        """Write nothing: `write_text` begins paragraphs."""

    def write_text(self, text: str) -> None:
        """Write paragraphs, between which are empty lines."""
        self.write_heading("Description")
        for number, paragraph in enumerate(text.split("\n\n")):
            self.lines += [*[".PP"] * (number > 0), *_wrapped(paragraph)]

    def write_dl(self, rows: Iterable[tuple[str, str]], col_max: int = 30, col_spacing: int = 2) -> None:
        """Write terms, each with its description. The last two arguments are for a terminal."""
        for term, description in rows:
            self.lines += [".TP", f"\\fB{_roff(term)}\\fR", *_wrapped(description)]

    @contextmanager
    def section(self, name: str) -> Iterator[None]:
        """Write a heading before the lines that the block writes."""
        self.write_heading(name)
        yield


@click.command()
def man() -> None:
    """Print the manual page of hsplat and all of its commands.

    It is roff source: `hsplat man | man -l -` shows it. `hsplat man > ~/.local/share/man/man1/hsplat.1` keeps it where
    `man hsplat` finds it.
    """
    root = click.get_current_context().find_root()
    assert isinstance(root.command, click.Group)
    page = RoffFormatter()
    page.lines += [f'.TH HSPLAT 1 "" "hsplat {_roff(package_versions()["hsplat"])}"', ".SH NAME"]
    page.lines += [f"hsplat \\- {_roff((root.command.help or '').rstrip('.').lower())}"]
    root.command.format_help(root, page)
    for name in root.command.list_commands(root):
        command = root.command.get_command(root, name)
        assert command is not None, name
        page.is_below = True
        command.format_help(click.Context(command, root, name), page)
    page.is_below = False
    for heading, rows in (("Exit status", _EXIT_CODES), ("Environment", _VARIABLES)):
        with page.section(heading):
            page.write_dl(rows)
    Reporter().result(join_lines(page.lines))


def _wrapped(text: str) -> list[str]:
    """Return the lines of a text, none of which begins with a request of roff."""
    lines = textwrap.wrap(" ".join(text.split()), _WIDTH, break_long_words=False, break_on_hyphens=False)
    return [f"\\&{_roff(line)}" if line[0] in ".'" else _roff(line) for line in lines]


def _roff(text: str) -> str:
    """Return a text with the characters that have a meaning in roff, or are not in ASCII, as escapes."""
    return "".join(_ESCAPES.get(char, char) if char.isascii() else f"\\[u{ord(char):04X}]" for char in text)
