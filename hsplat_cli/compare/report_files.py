"""Reports a comparison, worst frames first: as text for the terminal, and as files of JSON, JUnit XML and HTML.

Equal comparisons give equal reports. All texts are printable, except in JSON.
"""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import get_args
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from hsplat_cli.compare.comparison_html import Gallery, comparison_page
from hsplat_cli.compare.frame_difference import COMPARISON_METRICS
from hsplat_cli.compare.outcome import Comparison, Outcome, Status, figure_text
from hsplat_cli.reports import require_own_page
from hsplat_cli.terminal import format_table
from renderer.errors import HsplatError, InputError
from renderer.film import WrittenFiles, locked_files, require_writable, staged_files, translate_os_errors
from renderer.scene import MAX_SIDECAR_BYTES, counted, read_json_object
from renderer.system import PrintableText, join_lines, printable

# Allowed suffixes of each report, by its option. No frame or scene file has them, so that a typing mistake overwrites
# no such file.
_SUFFIXES = {"--json": (".json",), "--junit": (".xml",), "--html": (".html", ".htm"), "--output": (".html", ".htm")}
# Largest number of failing frames that the terminal shows, so that they fit on a screen; files have all frames.
MAX_ROWS = 20

# The name, in `Comparison.facts`, of the device that drew the frames: another device explains small errors.
_DEVICE = "device"
# The strictness that allows for the differences between drivers.
_LOOSEST = "cross-driver"


@dataclass(frozen=True)
class ReportFiles:
    """Holds the paths of the requested reports, by option, and writes the reports."""

    paths: Mapping[str, Path]

    def require_names(self, inputs: Iterable[Path]) -> None:
        """Raise InputError if a name has a wrong suffix, or belongs to an input, a sidecar or another page."""
        for option, path in self.paths.items():
            where, suffixes = f"{option} {path}", _SUFFIXES[option]
            if path.suffix.lower() not in suffixes:
                got = f"a {path.suffix} file" if path.suffix else "no suffix"
                raise InputError("not a name for a report", where=where, got=got, expected=f"a {suffixes[0]} file")
            if os.path.exists(path) and not os.path.isfile(path):  # a device, or a pipe
                got = "a folder" if os.path.isdir(path) else "a special file"
                raise InputError("a report cannot replace this", where=where, got=got)
        WrittenFiles([*self.paths.values()]).require_harmless(inputs)
        for option in self.paths.keys() & {"--html", "--output"}:
            require_own_page(self.paths[option])
        record = self.paths.get("--json")
        if record is not None and "scene" in (read_json_object(record, MAX_SIDECAR_BYTES) or {}):
            raise InputError(
                "this report would overwrite the record of a scene",
                where=f"--json {record}",
                got="the JSON file of a film, of goldens or of a study",
                hint="give the report another name",
            )

    @contextlib.contextmanager
    def locked(self) -> Iterator[None]:
        """Make missing folders and lock the reports. Raises the errors of `renderer.film.locked_files`."""
        for path in self.paths.values():
            with translate_os_errors(path):
                path.parent.mkdir(parents=True, exist_ok=True)
        with locked_files(self.paths.values()):
            yield

    def prepare(self) -> None:
        """Remove the reports of an earlier comparison, which must not stay if the new comparison fails.

        Raises InputError or RenderError if one of the new reports cannot be written.
        """
        for path in self.paths.values():
            with translate_os_errors(path):
                path.unlink(missing_ok=True)
        for path in self.paths.values():
            require_writable(path)

    def write(self, comparison: Comparison, gallery: Gallery) -> None:
        """Write all reports; if one of them cannot be written, write none."""
        page = partial(comparison_page, gallery=gallery)
        self._write({"--json": comparison_json, "--junit": comparison_junit, "--html": page}, comparison)

    def write_failure(self, golden: Path, actual: Path, error: Exception) -> None:
        """Report the reason why nothing was compared, as JSON and JUnit where they are requested."""
        why = str(error) if isinstance(error, HsplatError) else f"{type(error).__name__}: {error}"
        self._write({"--json": failure_json, "--junit": failure_junit}, str(golden), str(actual), why)

    def _write(self, makers: Mapping[str, Callable[..., str]], *contents: object) -> None:
        """Write the requested reports. makers: by option, a function that makes the report from `contents`."""
        with staged_files() as write:
            for option, path in self.paths.items():
                if option in makers:
                    write(path, makers[option](*contents).encode())


# The content of the reports: text, JSON, JUnit


def comparison_table(comparison: Comparison) -> PrintableText:
    """Return a line for each of the worst failing frames, with the reason, then a summary and notes."""
    failing = [outcome for outcome in comparison.worst_first if not outcome.passes]
    rows = [("frame", "status", "reason"), *((o.name, o.status, _reason(o)) for o in failing[:MAX_ROWS])]
    lines: list[str] = [format_table(rows)] if failing else []
    if len(failing) > MAX_ROWS:
        lines.append(f"... and {counted(len(failing) - MAX_ROWS, 'more frame')} that fail; --json FILE has all of them")
    return join_lines([*lines, *([""] if lines else []), comparison.summary, *_remarks(comparison)])


def _reason(outcome: Outcome) -> str:
    more = len(outcome.exceeded) - 1
    if more < 1:
        return outcome.why
    return f"{outcome.why}; {counted(more, 'more figure')} over {'its limit' if more == 1 else 'their limits'}"


def _remarks(comparison: Comparison) -> Iterator[str]:
    worst = comparison.worst_first[0]
    if worst.status == "close":
        yield f"  {worst.name}: {worst.why}"
    yield from (f"note: {note}" for note in comparison.notes)
    if comparison.passes:
        return
    for name, (golden, actual) in comparison.facts.items():
        if golden != actual:
            yield f"{name}: {actual}; of the goldens: {golden}"
            if name == _DEVICE and comparison.level != _LOOSEST:
                yield f"hint: another driver causes small differences; --level {_LOOSEST} allows for them"


def comparison_json(comparison: Comparison) -> str:
    """Return an object with `passes`, `counts` by status, `frames`, and the units of their errors in `figures`."""
    used = {name for outcome in comparison.outcomes for name in outcome.limits}
    data = {
        "passes": comparison.passes,
        "golden": comparison.golden,
        "actual": comparison.actual,
        "level": comparison.level,
        "other_limits": list(comparison.other_limits),
        "counts": {status: comparison.counts[status] for status in get_args(Status)},
        "notes": list(comparison.notes),
        "facts": {name: {"golden": golden, "actual": actual} for name, (golden, actual) in comparison.facts.items()},
        "figures": {
            figure.name: {"label": figure.label, "unit": figure.unit, "higher_is_better": figure.higher_is_better}
            for figure in COMPARISON_METRICS.values()
            if figure.name in used
        },
        "frames": [
            {**vars(outcome), "number": comparison.frame_numbers.get(outcome.name), "passes": outcome.passes}
            for outcome in comparison.worst_first
        ],
    }
    return _json_text(data)


def failure_json(golden: str, actual: str, why: str) -> str:
    """Return an object with `passes: false` and `error`, for frames that cannot be compared."""
    return _json_text({"passes": False, "golden": golden, "actual": actual, "error": why})


def _json_text(data: dict[str, object]) -> str:
    # In ASCII, which can represent names with invalid UTF-8.
    return f"{json.dumps(data, indent=2, allow_nan=False)}\n"


def comparison_junit(comparison: Comparison) -> str:
    """Return a test suite with a test case for each frame, in the format that Jenkins and GitLab read."""
    golden = printable(comparison.golden)
    name = f"{golden} at {printable(comparison.strictness)}"
    root, suite = _new_suite(name, len(comparison.outcomes), comparison.num_failing, 0)
    if comparison.facts:
        properties = SubElement(suite, "properties")  # JUnit wants them before the test cases
        for fact, sides in comparison.facts.items():
            for side, value in zip(("golden", "actual"), sides, strict=True):
                SubElement(properties, "property", name=printable(f"{side} {fact}"), value=printable(value))
    for outcome in comparison.worst_first:
        case = SubElement(suite, "testcase", classname=golden, name=printable(outcome.name))
        if not outcome.passes:
            message = printable(f"{outcome.status}: {_reason(outcome)}")
            failure = SubElement(case, "failure", message=message, type=outcome.status)
            failure.text = join_lines(_details(comparison, outcome))
    if comparison.notes:
        SubElement(suite, "system-out").text = join_lines(comparison.notes)
    return _xml_text(root)


def _new_suite(name: str, num_tests: int, num_failures: int, num_errors: int) -> tuple[Element, Element]:
    counts = {"tests": str(num_tests), "failures": str(num_failures), "errors": str(num_errors)}
    root = Element("testsuites", {"name": "hsplat compare", **counts})
    return root, SubElement(root, "testsuite", {"name": name, **counts, "skipped": "0"})


def failure_junit(golden: str, actual: str, why: str) -> str:
    """Return a test suite with one error, for frames that cannot be compared: CI systems ignore a missing report."""
    name = printable(golden)
    root, suite = _new_suite(name, 1, 0, 1)
    case = SubElement(suite, "testcase", classname=name, name="could not be compared")
    lines = why.split("\n")
    error = SubElement(case, "error", message=printable(lines[0]), type="not compared")
    error.text = join_lines([*lines, f"golden: {golden}", f"actual: {actual}"])
    return _xml_text(root)


def _xml_text(root: Element) -> str:
    indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{tostring(root, encoding="unicode")}\n'


def _details(comparison: Comparison, outcome: Outcome) -> Iterator[str]:
    yield outcome.why
    yield f"golden: {comparison.golden}"
    yield f"actual: {comparison.actual}"
    yield f"level: {comparison.strictness}"
    for name, value in outcome.figures.items():
        verdict = "FAILS" if name in outcome.exceeded else "passes"
        yield f"{verdict}: {figure_text(name, value, outcome.limits[name])}"
    if outcome.bias:
        biases = ", ".join(f"{bias:.3g}" for bias in outcome.bias)
        yield f"mean signed errors of the channels {biases} steps, without a limit"
