"""Compare pairs of frames with their limits."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from hsplat_cli.compare.figure_format import figure_text
from hsplat_cli.compare.outcome import Outcome, Status
from hsplat_cli.compare.pair import Pair
from hsplat_cli.compare.rules import Rules
from renderer.errors import InputError, require_package
from renderer.film import Pixels
from renderer.study import COMPARISON_METRICS, FrameDifference, Limits, exceeded_limits, severity

# Metrics that need another package: its name and the extra that installs it.
_PACKAGES = {"flip": ("flip_evaluator", "compare"), "ssim": ("skimage", "measure")}

_KINDS = {3: "RGB", 4: "RGBA"}


def compare_pairs(pairs: Iterable[Pair], rules: Rules, on_outcome: Callable[[Outcome, Pair], None]) -> list[Outcome]:
    """Compare each pair, and call `on_outcome` with each outcome as soon as it is known.

    Raises InputError if a limited metric cannot be computed; if a package is missing, before the first pair.
    """
    require_packages(rules)
    outcomes = []
    for pair in pairs:
        outcome = compare_pair(pair, rules.limits_for(pair.name))
        on_outcome(outcome, pair)
        outcomes.append(outcome)
    return outcomes


def require_packages(rules: Rules) -> None:
    """Raise InputError if a package is missing that the limit of any frame needs."""
    limited = {figure for name in ("", *rules.frames) for figure in rules.limits_for(name)}
    for figure, (package, extra) in _PACKAGES.items():
        if figure in limited:
            require_package(package, extra=extra)


def compare_pair(pair: Pair, limits: Limits) -> Outcome:
    """Compare one pair. Raises InputError if a limited metric cannot be computed."""
    if pair.golden is None or pair.actual is None:
        status: Status = "missing" if pair.actual is None or pair.is_golden_missing else "extra"
        side = "ACTUAL" if pair.actual is None else "GOLDEN"
        return Outcome(pair.name, status, f"{side} has no such frame", limits=limits, number=pair.number)
    if pair.golden.shape != pair.actual.shape:
        return _mismatched_outcome(pair, pair.golden, pair.actual, limits)
    if pair.golden is pair.actual or np.array_equal(pair.golden, pair.actual):
        figures = {name: float(COMPARISON_METRICS[name].higher_is_better) for name in limits}
        channels = pair.golden.shape[2]
        return Outcome(
            pair.name, "same", "the same pixels", figures, limits, bias=(0.0,) * channels, number=pair.number
        )
    return _difference_outcome(pair, FrameDifference(pair.golden, pair.actual), limits)


def _mismatched_outcome(pair: Pair, golden: Pixels, actual: Pixels, limits: Limits) -> Outcome:
    (height, width, channels), (other_height, other_width, other_channels) = golden.shape, actual.shape
    if (height, width) != (other_height, other_width):
        why = f"{other_width} x {other_height} pixels, the golden has {width} x {height}"
        return Outcome(pair.name, "other size", why, limits=limits, number=pair.number)
    why = f"{_KINDS[other_channels]}, the golden is {_KINDS[channels]}: alpha is {'lost' if channels == 4 else 'new'}"
    return Outcome(pair.name, "other channels", why, limits=limits, number=pair.number)


def _difference_outcome(pair: Pair, difference: FrameDifference, limits: Limits) -> Outcome:
    figures = difference.metrics(limits)
    for name in limits:
        if name not in figures:
            hint = f"remove the limit for this frame: {name}: none"
            raise InputError(f"too small a picture for {COMPARISON_METRICS[name].label}", where=pair.name, hint=hint)
    over = exceeded_limits(figures, limits)
    worst = max(limits, key=lambda name: severity(figures, {name: limits[name]}))
    name = over[0] if over else worst
    text = figure_text(name, figures[name], limits[name])
    if difference.largest() == 0:
        text = "the same picture: only colours at an alpha of 0 differ"
    elif not over:
        text = f"within the limits; the closest is {text}"
    return Outcome(
        pair.name,
        "different" if over else "close",
        text,
        figures,
        limits,
        over,
        difference.bias,
        pair.number,
    )
