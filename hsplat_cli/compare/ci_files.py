"""Write the outcomes of a comparison for CI: JUnit, code quality, a summary in Markdown, and lines of GitHub.

Names may have any characters: each format escapes them. JUnit is as Jenkins' schema junit-10.xsd has it, which GitLab
reads, too. Code quality has the keys that GitLab's documentation lists.
"""

from __future__ import annotations

import hashlib
import html
import json
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from hsplat_cli.compare.golden.record import GOLDEN_RECORD_FILE
from hsplat_cli.compare.outcome import MOST_CHANGES, Change, ComparedFilm, ComparedFrame, Comparison
from renderer.accuracy import MOST_DB
from renderer.scene import counted
from renderer.system import join_lines, printable

# The most errors of a step that GitHub shows.
_MOST_ERRORS = 10
# The most films in the table of the summary, which GitHub drops if it is larger than 1 MiB.
_MOST_ROWS = 200
# The most films that the summary shows with their changes and frames, and the most frames of each.
_MOST_FILMS = 3
_MOST_FRAMES = 3
# The most characters of a text that may come from a file, such as the message of an error.
_MOST_CHARACTERS = 400


def junit(comparison: Comparison) -> str:
    """Return a test suite for each film, with a test case for each frame, in the format of Jenkins and GitLab."""
    root = Element("testsuites", name="hsplat compare")
    for film in comparison.worst_first:
        _add_suite(root, film)
    for key in ("tests", "failures", "errors"):
        root.set(key, str(sum(int(suite.get(key, 0)) for suite in root)))
    indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{tostring(root, encoding="unicode")}\n'


def _add_suite(root: Element, film: ComparedFilm) -> None:
    name = printable(film.name)
    errors = int(film.verdict == "not compared")
    counts = {"tests": len(film.frames) + errors, "failures": len(film.failing), "errors": errors, "skipped": 0}
    suite = SubElement(root, "testsuite", {"name": name} | {key: str(count) for key, count in counts.items()})
    if errors:
        case = SubElement(suite, "testcase", classname=name, name="could not be compared")
        SubElement(case, "error", message=printable(film.summary), type="not compared")
    for frame in film.frames:
        case = SubElement(suite, "testcase", classname=name, name=printable(frame.name))
        if not frame.passes:
            failure = SubElement(case, "failure", message=printable(frame.why), type=frame.status)
            flip = [] if frame.flip is None else [f"FLIP {frame.flip:.3g}"]
            nearness = [frame.nearness] if frame.nearer else []
            changes = [change.words for change in film.changes]
            failure.text = join_lines([f"limit: {film.limit}", *flip, *nearness, *changes])


@dataclass(frozen=True)
class _Finding:
    """The place at which a film that does not pass is reported.

    line: the line in the file, at least 1. keys: the keys that changed there.
    """

    film: ComparedFilm
    line: int
    keys: Sequence[str]
    text: str

    @property
    def file(self) -> str:
        """Return the file of the scene, or the golden.json of goldens without a scene; empty for pictures."""
        golden_json = f"{self.film.goldens}/{GOLDEN_RECORD_FILE}" if self.film.goldens else ""
        return self.film.scene or golden_json


def code_quality(comparison: Comparison) -> str:
    """Return a list of issues, as GitLab shows them in merge requests: one for each changed key of films that fail.

    A fingerprint stays the same while the same keys fail, whatever the figures are.
    """
    issues = []
    for finding in _findings(comparison):
        if not finding.file:
            continue  # an issue needs a file
        subject = json.dumps([finding.film.name, *finding.keys])
        issues.append(
            {
                "description": finding.text,
                "check_name": "hsplat compare",
                "fingerprint": hashlib.blake2b(subject.encode(), digest_size=16).hexdigest(),
                "severity": "major",
                "location": {"path": _in_repository(finding.file), "lines": {"begin": finding.line}},
            }
        )
    return f"{json.dumps(issues, indent=2)}\n"


def github_lines(comparison: Comparison) -> Iterator[str]:
    """Yield the workflow commands of GitHub that show errors at the changed keys of scenes.

    GitHub shows few of them: the first key of each film comes before the second of any.
    """
    findings = _findings(comparison)
    shown = findings if len(findings) <= _MOST_ERRORS else findings[: _MOST_ERRORS - 1]
    for finding in shown:
        file, title = finding.file, _property(f"golden film {finding.film.name}")
        place = f"file={_property(_in_repository(file))},line={finding.line}," if file else ""
        yield f"::error {place}title={title}::{_data(finding.text)}"
    if len(findings) > len(shown):
        more = counted(len(findings) - len(shown), "more change")
        yield github_error(f"and {more} of films that do not pass: see the report")


def github_error(text: str) -> str:
    """Return the workflow command of GitHub that shows an error without a place."""
    return f"::error title=golden films::{_data(text)}"


def _in_repository(path: str) -> str:
    """Return a path relative to the repository that CI has checked out, in place of the current folder."""
    root = os.environ.get("GITHUB_WORKSPACE") or os.environ.get("CI_PROJECT_DIR")
    return Path(os.path.relpath(Path(path).resolve(), Path(root).resolve())).as_posix() if root else path


def _findings(comparison: Comparison) -> list[_Finding]:
    """Return the places at which films that do not pass are reported: the first of each film, then the second ones."""
    films = [film for film in comparison.worst_first if film.verdict != "passes"]
    ranked = [(rank, finding) for film in films for rank, finding in enumerate(_findings_of(film))]
    return [finding for _, finding in sorted(ranked, key=lambda each: each[0])]


def _findings_of(film: ComparedFilm) -> Iterator[_Finding]:
    """Yield the places at which a film is reported: each line with mistakes, or with changed keys, or the first line.

    Changes that have no line, such as those of the volume, are told at the first place.
    """
    for mistake in film.mistakes:
        yield _Finding(film, mistake.line, [mistake.text], _short(mistake.text))
    if film.mistakes:
        return
    lines: dict[int, list[Change]] = {}
    for change in film.changes:
        if change.line:
            lines.setdefault(change.line, []).append(change)
    others = [change for change in film.changes if not change.line]
    for line, changes in sorted((lines or {1: []}).items()):
        told = [*changes, *others]
        texts = [change.words for change in told[:MOST_CHANGES]]
        yield _Finding(film, line, [change.key for change in told], "; ".join([_short(film.summary), *texts]))
        others = []


def _property(text: str) -> str:
    """Escape a property of a workflow command."""
    return _data(text).replace(":", "%3A").replace(",", "%2C")


def _data(text: str) -> str:
    """Escape the message of a workflow command, which is one line."""
    return printable(text).replace("%", "%25")


def summary_markdown(comparison: Comparison) -> str:
    """Return a summary in Markdown: a table of all films, and the worst frames of the worst films."""
    films = comparison.worst_first
    rows = [(_cell(film.name), _cell(film.summary), _cell(film.limit), _worst_part(film)) for film in films]
    lines = [f"### {_cell(comparison.summary)}", "", *_table(("film", "verdict", "limit", "worst part"), rows)]
    if len(films) > _MOST_ROWS:
        lines += ["", f"and {counted(len(films) - _MOST_ROWS, 'more film')}"]
    failing = [film for film in films if film.verdict == "fails"]
    for film in failing[:_MOST_FILMS]:
        lines += ["", *_film_section(film)]
    if failing:
        lines += ["", "The report's page, `index.html`, shows all pictures, and has the command to accept new ones."]
    return "\n".join(lines) + "\n"


def _film_section(film: ComparedFilm) -> Iterator[str]:
    """Yield the lines on a film that fails: what changed, and its worst frames with their figures."""
    yield f"**{_cell(film.name)}**"
    yield ""
    for change in film.changes[:MOST_CHANGES]:
        yield f"- {_cell(change.words)}"
    if film.changes:
        yield ""
    frames = film.failing[:_MOST_FRAMES]
    columns = ("frame", "verdict", "PSNR", "worst part", "FLIP", "largest error", "exact picture")
    yield from _table(columns, [_frame_row(frame) for frame in frames])
    if len(film.failing) > len(frames):
        yield ""
        yield f"and {counted(len(film.failing) - len(frames), 'more frame')} that fail"


def _frame_row(frame: ComparedFrame) -> Sequence[str]:
    return (
        _cell(frame.name),
        _cell(frame.status if frame.psnr is not None else frame.why),
        _decibels(frame.psnr),
        _decibels(frame.part_psnr),
        "" if frame.flip is None else f"{frame.flip:.3g}",
        "" if frame.largest is None else f"{frame.largest:.0f} of 255",
        _cell(frame.nearness),
    )


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Iterator[str]:
    for row in (columns, ["---"] * len(columns), *rows[:_MOST_ROWS]):
        yield f"| {' | '.join(row)} |"


def _worst_part(film: ComparedFilm) -> str:
    """Return the lowest PSNR of a part in a film."""
    return _decibels(min((frame.part_psnr for frame in film.frames if frame.part_psnr is not None), default=None))


def _decibels(psnr: float | None) -> str:
    return "" if psnr is None or psnr >= MOST_DB else f"{psnr:.1f} dB"


def _cell(text: str) -> str:
    """Escape a text for a cell of a table in Markdown."""
    escaped = html.escape(_short(text), quote=False)
    return "".join(f"\\{each}" if each in "\\`*_[]|~#$" else each for each in escaped)


def _short(text: str) -> str:
    """Return a text that is printable and not too long."""
    shown = printable(text)
    return shown if len(shown) <= _MOST_CHARACTERS else f"{shown[:_MOST_CHARACTERS]}..."
