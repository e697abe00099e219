"""Prints the output of commands; nothing else in the package prints.

Results and lines go to the standard output stream, all else to the standard error stream. A text is one line, with line
breaks and other unprintable characters escaped, unless `join_lines` made it.
"""

from __future__ import annotations

import sys
from collections.abc import Collection, Iterator, Sequence
from contextlib import AbstractContextManager, closing, contextmanager
from dataclasses import dataclass

import click

from hsplat_cli.terminal.progress_bar import PassProgress, Progress
from renderer.system import PrintableText, join_lines, printable


@dataclass(frozen=True)
class Reporter:
    """Prints the output of a command. A command makes a Reporter from its option `--quiet` and hands it down.

    is_quiet: whether only results and warnings are printed.
    """

    is_quiet: bool = False

    def result(self, text: str) -> None:
        """Print a result that the user asked for, also when quiet."""
        click.echo(printable(text))

    def content(self, content: bytes) -> None:
        """Print the content of a file as it is, whatever the encoding of the terminal."""
        click.echo(content, nl=False)

    def confirm(self, question: str) -> bool:
        """Ask the user, and return whether the answer is yes."""
        return click.confirm(question)

    def line(self, text: str) -> None:
        """Print an outcome of the work, such as the file that was written; nothing when quiet."""
        if not self.is_quiet:
            self.result(text)

    def note(self, text: str) -> None:
        """Print a note, a line that begins with `note:`; nothing when quiet."""
        self.line(f"note: {text}")

    def status(self, text: str) -> None:
        """Print the current step on the standard error stream; nothing when quiet."""
        if not self.is_quiet:
            self.warning(text)

    def warning(self, text: str) -> None:
        """Print a warning or an error on the standard error stream, also when quiet."""
        click.echo(printable(text), err=True)

    def relay(self, content: bytes) -> None:
        """Print on the standard error stream the text that another process of the same command has printed."""
        click.echo(content, nl=False, err=True)

    def progress(
        self, steps: int | Sequence[float], *, label: str, unit: str = "frames"
    ) -> AbstractContextManager[Progress]:
        """Show the number of finished steps and the remaining time on the standard error stream.

        steps: the number of steps of equal cost, whose rate is shown, too; or the predicted work of each step, at
            least 0, in any unit. unit: the plural noun of a step.
        """
        return closing(Progress(steps, label, None if self.is_quiet else sys.stderr, unit=unit))

    @contextmanager
    def passes(self) -> Iterator[None]:
        """Show each pass over voxels that takes longer than a second, as `progress` does, in a `with` block."""
        from renderer.volume import watched_passes

        with closing(PassProgress(None if self.is_quiet else sys.stderr)) as watcher, watched_passes(watcher):
            yield


def format_table(rows: Sequence[Sequence[str]], right_aligned: Collection[int] = ()) -> PrintableText:
    """Return rows of cells as lines, in columns two spaces apart, without trailing spaces.

    right_aligned: the indices of the columns that are aligned to the right.
    """
    cells = [[printable(cell) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return join_lines(
        "  ".join(
            cell.rjust(width) if k in right_aligned else cell.ljust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in cells
    )
