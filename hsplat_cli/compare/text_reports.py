"""What came of a comparison as text for the terminal, as JSON and as JUnit XML; worst first in all of them.

The same comparison gives the same text. Names are shown as `printable` has them, but in JSON as they are.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator
from typing import Any
from xml.etree import ElementTree

from hsplat_cli.compare.figure_format import figure_text, printable
from hsplat_cli.compare.outcome import Comparison, Failure, Outcome, Status
from hsplat_cli.terminal import counted
from renderer.study import COMPARISON_METRICS

# The worst of those that fail; a terminal shows them at once. All are in the files.
MAX_ROWS = 20

_ORDER: tuple[Status, ...] = ("different", "missing", "extra", "other size", "other channels", "same", "close")
_WORDS = {
    "same": "the same",
    "extra": "not among the goldens",
    "other size": "of another size",
    "other channels": "with other channels",
}

_DRIVER = "driver"
_LOOSEST = "cross-driver"


# The terminal


def comparison_table(comparison: Comparison) -> str:
    """A line for each of the worst frames that fail, with the reason, then a summary and what else is to be known."""
    failing = [outcome for outcome in comparison.worst_first if not outcome.passes]
    lines = list(_table(failing[:MAX_ROWS]))
    if len(failing) > MAX_ROWS:
        lines.append(f"... and {counted(len(failing) - MAX_ROWS, 'more frame')} that fail; --json FILE has all of them")
    return "\n".join([*lines, *([""] if lines else []), *_summary(comparison), *_remarks(comparison)])


def _table(failing: list[Outcome]) -> Iterator[str]:
    if not failing:
        return
    rows = [("frame", "status", "reason"), *((printable(each.name), each.status, _reason(each)) for each in failing)]
    widths = [max(len(row[column]) for row in rows) for column in range(2)]
    for name, status, reason in rows:
        yield f"{name.ljust(widths[0])}  {status.ljust(widths[1])}  {reason}"


def _reason(outcome: Outcome) -> str:
    more = len(outcome.exceeded) - 1
    if more < 1:
        return outcome.why
    return f"{outcome.why}; {counted(more, 'more figure')} over {'its limit' if more == 1 else 'their limits'}"


def _summary(comparison: Comparison) -> Iterator[str]:
    counts = Counter(outcome.status for outcome in comparison.outcomes)
    parts = ", ".join(f"{counts[status]} {_WORDS.get(status, status)}" for status in _ORDER if counts[status])
    num, num_failing = len(comparison.outcomes), sum(not outcome.passes for outcome in comparison.outcomes)
    if num_failing:
        yield f"{num_failing} of {counted(num, 'frame')} {'fails' if num_failing == 1 else 'fail'}: {parts}"
        return
    verb = "passes" if num == 1 else "pass"
    yield f"{counted(num, 'frame')} {verb} at {printable(comparison.strictness)}: {parts}"
    worst = comparison.worst_first[0]
    if worst.status == "close":
        yield f"  {printable(worst.name)}: {worst.why}"


def _remarks(comparison: Comparison) -> Iterator[str]:
    yield from (f"note: {printable(note)}" for note in comparison.notes)
    if comparison.passes:
        return
    for name, (golden, actual) in comparison.facts.items():
        if golden != actual:
            yield f"{printable(name)}: {printable(actual)}; of the goldens: {printable(golden)}"
    drivers = comparison.facts.get(_DRIVER)
    if drivers is not None and drivers[0] != drivers[1] and comparison.level != _LOOSEST:
        yield f"hint: with another driver small differences are to be expected, for which there is --level {_LOOSEST}"


# JSON


def comparison_json(comparison: Comparison) -> str:
    """An object with `passes`, `counts` by status, and `frames`; figures and limits are in the units of `figures`."""
    used = {name for outcome in comparison.outcomes for name in outcome.limits}
    data = {
        "passes": comparison.passes,
        "golden": comparison.golden,
        "actual": comparison.actual,
        "level": comparison.level,
        "other_limits": list(comparison.other_limits),
        "counts": {status: sum(each.status == status for each in comparison.outcomes) for status in _ORDER},
        "notes": list(comparison.notes),
        "facts": {name: {"golden": golden, "actual": actual} for name, (golden, actual) in comparison.facts.items()},
        "figures": {
            figure.name: {"label": figure.label, "unit": figure.unit, "higher_is_better": figure.higher_is_better}
            for figure in COMPARISON_METRICS.values()
            if figure.name in used
        },
        "frames": [_record(outcome) for outcome in comparison.worst_first],
    }
    return _json_text(data)


def failure_json(failure: Failure) -> str:
    """An object with `passes`, which is false, and `error` instead of what came of the frames."""
    return _json_text({"passes": False, "golden": failure.golden, "actual": failure.actual, "error": failure.why})


def _json_text(data: dict[str, Any]) -> str:
    # ASCII, so that also names with bytes that are no UTF-8 have a form.
    return f"{json.dumps(data, indent=2, allow_nan=False)}\n"


def _record(outcome: Outcome) -> dict[str, Any]:
    return {
        "name": outcome.name,
        "number": outcome.number,
        "status": outcome.status,
        "passes": outcome.passes,
        "why": outcome.why,
        "figures": dict(outcome.figures),
        "limits": dict(outcome.limits),
        "exceeded": list(outcome.exceeded),
        "bias": list(outcome.bias),
    }


# JUnit


def comparison_junit(comparison: Comparison) -> str:
    """A test suite with a test case for each frame, as Jenkins, GitLab and others read it."""
    num_failing = sum(not outcome.passes for outcome in comparison.outcomes)
    counts = {"tests": str(len(comparison.outcomes)), "failures": str(num_failing), "errors": "0"}
    root = ElementTree.Element("testsuites", {"name": "hsplat compare", **counts})
    name = f"{printable(comparison.golden)} at {printable(comparison.strictness)}"
    suite = ElementTree.SubElement(root, "testsuite", {"name": name, **counts, "skipped": "0"})
    _add_facts(suite, comparison)
    for outcome in comparison.worst_first:
        case = ElementTree.SubElement(
            suite, "testcase", {"classname": printable(comparison.golden), "name": printable(outcome.name)}
        )
        if not outcome.passes:
            message = f"{outcome.status}: {_reason(outcome)}"
            failure = ElementTree.SubElement(case, "failure", {"message": message, "type": outcome.status})
            failure.text = "\n".join(_details(comparison, outcome))
    if comparison.notes:
        ElementTree.SubElement(suite, "system-out").text = "\n".join(map(printable, comparison.notes))
    return _xml_text(root)


def _add_facts(suite: ElementTree.Element, comparison: Comparison) -> None:
    """As properties, which come first in a suite; the driver of the goldens is called `golden driver`."""
    if not comparison.facts:
        return
    properties = ElementTree.SubElement(suite, "properties")
    for fact, sides in comparison.facts.items():
        for side, value in zip(("golden", "actual"), sides, strict=True):
            name = printable(f"{side} {fact}")
            ElementTree.SubElement(properties, "property", {"name": name, "value": printable(value)})


def failure_junit(failure: Failure) -> str:
    """A test suite with one test case, which is an error: CI systems take no report at all for nothing wrong."""
    counts = {"tests": "1", "failures": "0", "errors": "1"}
    root = ElementTree.Element("testsuites", {"name": "hsplat compare", **counts})
    name = printable(failure.golden)
    suite = ElementTree.SubElement(root, "testsuite", {"name": name, **counts, "skipped": "0"})
    case = ElementTree.SubElement(suite, "testcase", {"classname": name, "name": "could not be compared"})
    lines = [printable(line) for line in failure.why.split("\n")]
    error = ElementTree.SubElement(case, "error", {"message": lines[0], "type": "not compared"})
    error.text = "\n".join([*lines, f"golden: {name}", f"actual: {printable(failure.actual)}"])
    return _xml_text(root)


def _xml_text(root: ElementTree.Element) -> str:
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, encoding="unicode")}\n'


def _details(comparison: Comparison, outcome: Outcome) -> Iterator[str]:
    yield outcome.why
    yield f"golden: {printable(comparison.golden)}"
    yield f"actual: {printable(comparison.actual)}"
    yield f"level: {printable(comparison.strictness)}"
    for name, value in outcome.figures.items():
        verdict = "FAILS" if name in outcome.exceeded else "passes"
        yield f"{verdict}: {figure_text(name, value, outcome.limits[name])}"
    if outcome.bias:
        biases = ", ".join(f"{bias:.3g}" for bias in outcome.bias)
        yield f"mean signed errors of the channels {biases} levels, without a limit"
