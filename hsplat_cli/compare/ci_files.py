"""Write the outcomes of a comparison for CI: JUnit, code quality, a summary in Markdown, and lines of GitHub.

Names may have any characters: each format escapes them.
"""

from __future__ import annotations

import hashlib
import html
import json
from collections.abc import Iterator
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from hsplat_cli.compare.outcome import Change, ComparedFilm, ComparedFrame, Comparison
from renderer.scene import counted
from renderer.system import join_lines, printable

# The most films, and the most frames of a film, in the summary.
_MOST_FILMS = 3
_MOST_FRAMES = 3


def junit(comparison: Comparison) -> str:
    """Return a test suite for each film, with a test case for each frame, in the format of Jenkins and GitLab."""
    root = Element("testsuites", name="hsplat compare")
    for film in comparison.worst_first:
        cases = len(film.frames) or 1
        errors = int(film.verdict == "not compared")
        counts = {"tests": str(cases), "failures": str(len(film.failing)), "errors": str(errors), "skipped": "0"}
        suite = SubElement(root, "testsuite", {"name": printable(film.name), **counts})
        if errors:
            case = SubElement(suite, "testcase", classname=printable(film.name), name="could not be compared")
            SubElement(case, "error", message=printable(film.summary), type="not compared")
        for frame in film.frames:
            case = SubElement(suite, "testcase", classname=printable(film.name), name=printable(frame.name))
            if not frame.passes:
                failure = SubElement(case, "failure", message=printable(frame.why), type=frame.status)
                failure.text = join_lines([f"limit: {film.limit}", *_nearness(frame), *map(change_text, film.changes)])
    indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{tostring(root, encoding="unicode")}\n'


def code_quality(comparison: Comparison) -> str:
    """Return a list of issues, as GitLab shows them in merge requests: one for each changed key of films that fail."""
    issues = []
    for film, line, text in _places(comparison):
        fingerprint = hashlib.blake2b(f"{film.name} {line} {text}".encode(errors="replace"), digest_size=16)
        issues.append(
            {
                "description": text,
                "check_name": "hsplat compare",
                "fingerprint": fingerprint.hexdigest(),
                "severity": "major",
                "location": {"path": film.scene, "lines": {"begin": line}},
            }
        )
    return f"{json.dumps(issues, indent=2)}\n"


def github_lines(comparison: Comparison) -> Iterator[str]:
    """Yield the workflow commands of GitHub that show errors at the changed keys of scenes."""
    for film, line, text in _places(comparison):
        place = _property(film.scene)
        yield f"::error file={place},line={line},title={_property('golden film ' + film.name)}::{_data(text)}"


def _places(comparison: Comparison) -> Iterator[tuple[ComparedFilm, int, str]]:
    """Yield the lines of scenes at which films that do not pass are reported, with a text."""
    for film in comparison.worst_first:
        if film.verdict == "passes" or not film.scene:
            continue
        lines: dict[int, list[Change]] = {}
        for change in film.changes:
            if change.line:
                lines.setdefault(change.line, []).append(change)
        for line, changes in sorted(lines.items()):
            yield film, line, f"{film.summary}; {'; '.join(map(change_text, changes))}"
        if not lines:
            yield film, 1, "; ".join([film.summary, *map(change_text, film.changes)])


def change_text(change: Change) -> str:
    """Return a change in words: `error.tolerance was 0.1, is 0.2`."""
    return f"{change.key} was {change.was or 'not there'}, is {change.now or 'gone'}"


def _property(text: str) -> str:
    """Escape a property of a workflow command."""
    return _data(text).replace(":", "%3A").replace(",", "%2C")


def _data(text: str) -> str:
    """Escape the message of a workflow command."""
    return printable(text).replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")


def summary_markdown(comparison: Comparison) -> str:
    """Return a summary in Markdown: a table of all films, and the worst frames of the worst films."""
    lines = [f"### {_cell(comparison.summary)}", "", "| film | verdict | limit | worst part |", "|---|---|---|---|"]
    for film in comparison.worst_first:
        worst = min((each.part_psnr for each in film.frames if each.part_psnr is not None), default=None)
        figure = "" if worst is None or worst >= 200 else f"{worst:.1f} dB"
        lines.append(f"| {_cell(film.name)} | {_cell(film.summary)} | {film.limit} | {figure} |")
    for film in comparison.worst_first[:_MOST_FILMS]:
        if film.verdict == "passes":
            continue
        lines += ["", f"**{_cell(film.name)}**", ""]
        lines += [f"- {_cell(change_text(change))}" for change in film.changes]
        lines += [f"- {_cell(frame.name)}: {_cell(frame.why)}" for frame in film.failing[:_MOST_FRAMES]]
        if len(film.failing) > _MOST_FRAMES:
            lines.append(f"- and {counted(len(film.failing) - _MOST_FRAMES, 'more frame')}")
    return "\n".join(lines) + "\n"


def _cell(text: str) -> str:
    """Escape a text for a cell of a table in Markdown."""
    escaped = html.escape(printable(text), quote=False)
    return "".join(f"\\{each}" if each in "\\`*_[]|~#" else each for each in escaped)


def _nearness(frame: ComparedFrame) -> Iterator[str]:
    if frame.nearer is not None:
        yield nearness_text(frame)


def nearness_text(frame: ComparedFrame) -> str:
    """Return which picture of a frame is nearer to the exact picture; empty if it was not measured."""
    if frame.nearer is None:
        return ""
    old, new, differs = frame.nearer.old, frame.nearer.new, frame.nearer.differs
    figures = f"the golden has {old:.1f} dB of the exact picture, the new one {new:.1f} dB"
    if not differs:
        return f"about as near to the exact picture: {figures}"
    return f"{'nearer to' if new > old else 'further from'} the exact picture: {figures}"
