"""A comparison as one page: the verdict, the error over the loop, the worst frames to be looked at, and all of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

from hsplat_cli.compare.curve import error_curve
from hsplat_cli.compare.gallery import PICTURE_PX, Exhibit, Gallery
from hsplat_cli.compare.outcome import PASSES, Comparison, Outcome
from hsplat_cli.compare.page_numbers import limit_text, share_text, signed_text, value_text
from hsplat_cli.compare.pair import Pixels
from hsplat_cli.report.html import page_of, png_data_uri
from hsplat_cli.report.numbers import ABSENT, bytes_text
from renderer.frame_difference import FIGURES
from renderer.strictness import LEVELS, severity

# What the pictures of a page may come to, as they are written into it. Where nothing can be compressed those of a frame
# take 4 MB: seven frames always fit.
MOST_BYTES = 30_000_000
GAINS = (1, 10, 50)
# Small pictures are shown larger, by whole pixels, as long as they stay smaller than this.
_LEAST_SHOWN_PX = 384
_CHANNELS = ("red", "green", "blue", "alpha")


def comparison_page(comparison: Comparison, gallery: Gallery) -> str:
    """The page, whole, in one file that loads nothing; the same comparison and pictures give the same text.

    Needs the package jinja2.
    """
    frames, num_bytes = _frames(gallery.exhibits)
    places = {frame["name"]: frame["place"] for frame in frames}
    names = [name for name in FIGURES if any(name in outcome.figures for outcome in comparison.outcomes)]
    numbers = {id(outcome): number for number, outcome in enumerate(comparison.outcomes)}
    return page_of(
        "compare.html",
        title=verdict(comparison),
        passes=comparison.passes,
        level=comparison.level,
        purpose=LEVELS[comparison.level].purpose if comparison.level in LEVELS else "",
        sides=[("compared", comparison.golden, comparison.actual, False), *_facts(comparison)],
        notes=comparison.notes,
        curve=error_curve(comparison),
        frames=frames,
        num_failing=sum(not outcome.passes for outcome in comparison.outcomes),
        size=bytes_text(num_bytes),
        picture_px=PICTURE_PX,
        gains=GAINS,
        default_gain=_default_gain(gallery.exhibits),
        figures=[FIGURES[name] for name in names],
        rows=[_row(o, names, numbers[id(o)], places.get(o.name)) for o in comparison.worst_first],
    )


def verdict(comparison: Comparison) -> str:
    """In one line, with the level: `3 of 48 frames differ at cross-driver: 1 missing, 2 different`."""
    outcomes, level = comparison.outcomes, comparison.level
    one = len(outcomes) == 1
    everything = "The frame is" if one else f"All {len(outcomes)} frames are"
    counts = Counter(outcome.status for outcome in outcomes)
    if counts["same"] == len(outcomes):
        return f"{everything} the same, pixel by pixel"
    if comparison.passes:
        same = f", {counts['same']} of them the same" if counts["same"] else ""
        return f"{everything} within the limits of {level}{same}"
    kinds = [f"{count} {status}" for status, count in sorted(counts.items()) if status not in PASSES]
    if one:
        return f"The frame differs at {level}: {outcomes[0].status}"
    num_failing = sum(not outcome.passes for outcome in outcomes)
    return f"{num_failing} of {len(outcomes)} frames differ at {level}: {', '.join(kinds)}"


def _facts(comparison: Comparison) -> list[tuple[str, str, str, bool]]:
    """Name, what each side has, and whether that differs."""
    return [(name, golden, actual, golden != actual) for name, (golden, actual) in comparison.facts.items()]


# ------------------------------------------------------------------------------------------------------- worst frames


def _frames(exhibits: Sequence[Exhibit]) -> tuple[list[dict[str, Any]], int]:
    """What the template shows of each, worst first, and the bytes of all pictures; as many as there is room for."""
    frames: list[dict[str, Any]] = []
    num_bytes = 0
    for exhibit in exhibits:
        pictures = _pictures(exhibit)
        size = sum(len(picture["uri"]) for picture in pictures)
        if num_bytes + size > MOST_BYTES:
            break
        num_bytes += size
        outcome = exhibit.outcome
        frames.append(
            {
                "place": f"worst-{len(frames) + 1}",
                "name": outcome.name,
                "status": outcome.status,
                "passes": outcome.passes,
                "why": outcome.why,
                "pictures": pictures,
                "flips": all(picture["uri"] for picture in pictures[:2]),
                "pixels_per_side": exhibit.pixels_per_side,
                "figures": [_figure(outcome, name) for name in FIGURES if name in outcome.figures],
                "bias": list(zip(_CHANNELS, map(signed_text, outcome.bias), strict=False)),
            }
        )
    return frames, num_bytes


def _default_gain(exhibits: Sequence[Exhibit]) -> int:
    """The largest, if it tells the errors of all frames apart, else the one before it."""
    largest = max((exhibit.difference.max() for exhibit in exhibits if exhibit.difference is not None), default=0)
    return GAINS[-1] if int(largest) * GAINS[-1] <= 255 else GAINS[-2]


def _pictures(exhibit: Exhibit) -> list[dict[str, Any]]:
    """Golden, actual and difference, also those that there are not."""
    outcome = exhibit.outcome
    why_none = "nothing to compare" if outcome.status in ("missing", "extra") else f"none: {outcome.status}"
    return [
        _picture("golden", exhibit.golden, outcome, "there is no such golden frame"),
        _picture("actual", exhibit.actual, outcome, "there is no such frame"),
        _picture("difference", exhibit.difference, outcome, why_none),
    ]


def _picture(kind: str, pixels: Pixels | None, outcome: Outcome, absent: str) -> dict[str, Any]:
    if pixels is None:
        return {"kind": kind, "uri": "", "absent": absent}
    height, width, channels = pixels.shape
    times = max(1, _LEAST_SHOWN_PX // max(height, width))
    return {
        "kind": kind,
        "uri": png_data_uri(pixels),
        "alt": f"{kind} of {outcome.name}",
        "width": times * width,
        "height": times * height,
        "classes": " ".join([*["enlarged"] * (times > 1), *["transparent"] * (channels == 4)]),
    }


def _figure(outcome: Outcome, name: str) -> dict[str, Any]:
    figure, value, limit = FIGURES[name], outcome.figures[name], outcome.limits.get(name)
    return {
        "label": figure.label,
        "value": value_text(value, limit),
        "unit": figure.unit,
        "limit": ABSENT if limit is None else limit_text(name, limit),
        "share": ABSENT if limit is None else share_text(severity({name: value}, {name: limit})),
        "is_over": name in outcome.exceeded,
    }


# --------------------------------------------------------------------------------------------------------- all frames


def _row(outcome: Outcome, names: Sequence[str], number: int, place: str | None) -> dict[str, Any]:
    return {
        "name": outcome.name,
        "number": number,
        "place": place,
        "status": outcome.status,
        "passes": outcome.passes,
        "why": outcome.why,
        "cells": [_cell(outcome.severity, share_text(outcome.severity), is_over=False), *_figure_cells(outcome, names)],
    }


def _figure_cells(outcome: Outcome, names: Sequence[str]) -> Iterator[dict[str, Any]]:
    for name in names:
        value = outcome.figures.get(name)
        text = ABSENT if value is None else value_text(value, outcome.limits.get(name))
        yield _cell(value, text, is_over=name in outcome.exceeded)


def _cell(value: float | None, text: str, *, is_over: bool) -> dict[str, Any]:
    """The number that it sorts by as JavaScript reads it."""
    return {
        "value": "" if value is None else repr(float(value)).replace("inf", "Infinity"),
        "text": text,
        "is_over": is_over,
    }
