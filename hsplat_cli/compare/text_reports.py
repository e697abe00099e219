"""Report a comparison as text for the terminal, as JSON and as JUnit XML, worst frames first.

Equal comparisons give equal text. Text is printable, except in JSON.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any, get_args
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from hsplat_cli.compare.figure_format import figure_text
from hsplat_cli.compare.outcome import Comparison, Outcome, Status
from hsplat_cli.terminal import counted, format_table
from renderer.study import COMPARISON_METRICS
from renderer.system import PrintableText, join_lines, printable

# Only the worst failing frames are printed, so that they fit on a screen; files have all frames.
MAX_ROWS = 20

_WORDS: dict[Status, str] = {
    "different": "different",
    "missing": "missing",
    "extra": "not among the goldens",
    "other size": "of another size",
    "other channels": "with other channels",
    "same": "the same",
    "close": "close",
}

_DRIVER = "driver"
_LOOSEST = "cross-driver"


def comparison_table(comparison: Comparison) -> PrintableText:
    """Return a line for each of the worst failing frames, with the reason, then a summary and notes."""
    failing = [outcome for outcome in comparison.worst_first if not outcome.passes]
    rows = [("frame", "status", "reason"), *((o.name, o.status, _reason(o)) for o in failing[:MAX_ROWS])]
    lines: list[str] = [format_table(rows)] if failing else []
    if len(failing) > MAX_ROWS:
        lines.append(f"... and {counted(len(failing) - MAX_ROWS, 'more frame')} that fail; --json FILE has all of them")
    return join_lines([*lines, *([""] if lines else []), summary(comparison), *_remarks(comparison)])


def _reason(outcome: Outcome) -> str:
    more = len(outcome.exceeded) - 1
    if more < 1:
        return outcome.why
    return f"{outcome.why}; {counted(more, 'more figure')} over {'its limit' if more == 1 else 'their limits'}"


def summary(comparison: Comparison) -> str:
    """Return the verdict in one line: `3 of 48 frames fail: 2 different, 1 missing, 45 the same`."""
    counts, num, num_failing = comparison.counts, len(comparison.outcomes), comparison.num_failing
    parts = ", ".join(f"{counts[status]} {words}" for status, words in _WORDS.items() if counts[status])
    if num_failing:
        return f"{num_failing} of {counted(num, 'frame')} {'fails' if num_failing == 1 else 'fail'}: {parts}"
    return f"{counted(num, 'frame')} {'passes' if num == 1 else 'pass'} at {comparison.strictness}: {parts}"


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
            if name == _DRIVER and comparison.level != _LOOSEST:
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


def _json_text(data: dict[str, Any]) -> str:
    # ASCII can represent names with invalid UTF-8.
    return f"{json.dumps(data, indent=2, allow_nan=False)}\n"


def comparison_junit(comparison: Comparison) -> str:
    """Return a test suite with a test case for each frame, as Jenkins, GitLab and others read it."""
    golden = printable(comparison.golden)
    name = f"{golden} at {printable(comparison.strictness)}"
    root, suite = _new_suite(name, len(comparison.outcomes), comparison.num_failing, 0)
    if comparison.facts:
        properties = SubElement(suite, "properties")  # these come first
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
    """Return a test suite with one error, for frames that cannot be compared; CI systems ignore a missing report."""
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
        yield f"mean signed errors of the channels {biases} levels, without a limit"
