"""Describe the outcomes of a comparison for the terminal."""

from __future__ import annotations

from collections.abc import Iterator

from hsplat_cli.compare.outcome import MOST_CHANGES, ComparedFilm, Comparison
from hsplat_cli.terminal import format_table
from renderer.scene import counted
from renderer.system import PrintableText, join_lines

# The most failing frames of a film that the terminal shows.
_MOST_ROWS = 10


def comparison_text(comparison: Comparison) -> PrintableText:
    """Return the verdicts on all films, with the reasons of those that do not pass, the worst last."""
    lines: list[str] = []
    for film in reversed(comparison.worst_first):
        lines += _film_lines(film, is_only=len(comparison.films) == 1)
    if len(comparison.films) > 1:
        lines.append(comparison.summary)
    return join_lines(lines)


def _film_lines(film: ComparedFilm, *, is_only: bool) -> Iterator[str]:
    if not is_only:
        yield f"{film.name}: {film.summary}"
    if film.verdict == "fails":
        rows = [(frame.name, frame.status, frame.why) for frame in film.failing[:_MOST_ROWS]]
        yield format_table([("frame", "status", "reason"), *rows])
        if len(film.failing) > len(rows):
            yield f"... and {counted(len(film.failing) - len(rows), 'more frame')} that fail"
        for frame in film.failing:
            if frame.nearer is not None:
                yield f"{frame.name}: {frame.nearness}"
        for change in film.changes[:MOST_CHANGES]:
            place = f"{film.scene}:{change.line}: " if change.line else ""
            yield f"{place}{change.words}"
    if is_only:
        yield film.summary
    yield from (f"note: {note}" for note in film.notes)
