"""A comparison as one page: the verdict, the error over the loop, the worst frames to be looked at, and all of them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

from hsplat_cli.compare.error_plot import plot_errors
from hsplat_cli.compare.figure_format import limit_text, printable, share_text, signed_text, value_text
from hsplat_cli.compare.gallery import PICTURE_PX, Gallery, GalleryFrame
from hsplat_cli.compare.outcome import PASSES, Comparison, Outcome
from hsplat_cli.compare.pair import Pixels
from hsplat_cli.reports import ABSENT, bytes_text, png_data_uri, render_page
from renderer.study import COMPARISON_METRICS, STRICTNESS_LEVELS, severity

# What the pictures of a page may come to, as they are written into it. Where nothing can be compressed those of a frame
# take 4 MB: seven frames always fit.
MAX_PICTURE_BYTES = 30_000_000
GAINS = (1, 10, 50)
# Small pictures are shown larger, by whole pixels, as long as they stay smaller than this.
_MIN_SHOWN_PX = 384
_CHANNELS = ("red", "green", "blue", "alpha")


def comparison_page(comparison: Comparison, gallery: Gallery) -> str:
    """The page, whole, in one file that loads nothing; the same comparison and pictures give the same text.

    Needs the package jinja2.
    """
    frames, num_bytes = _frames(gallery.gallery_frames)
    outcomes = comparison.outcomes
    order = {outcome.name: number for number, outcome in enumerate(outcomes)}
    anchors = {frame["name"]: frame["anchor"] for frame in frames}
    names = [name for name in COMPARISON_METRICS if any(name in outcome.figures for outcome in outcomes)]
    text = render_page(
        "compare.html",
        title=verdict(comparison),
        passes=comparison.passes,
        level=comparison.level,
        purpose=STRICTNESS_LEVELS[comparison.level].purpose,
        other_limits=comparison.other_limits,
        sides=_sides(comparison),
        notes=comparison.notes,
        curve=plot_errors(comparison),
        frames=frames,
        num_failing=sum(not outcome.passes for outcome in outcomes),
        size=bytes_text(num_bytes),
        picture_px=PICTURE_PX,
        gains=GAINS,
        default_gain=_default_gain(gallery.gallery_frames),
        figures=[COMPARISON_METRICS[name] for name in names],
        allows_nothing=any(_has_zero_limit(outcome) for outcome in outcomes),
        rows=[_row(o, names, order[o.name], anchors.get(o.name)) for o in comparison.worst_first],
    )
    # Names of files may have anything in them, also what has no form in UTF-8.
    return "\n".join(line if line.isprintable() else printable(line) for line in text.split("\n"))


def _has_zero_limit(outcome: Outcome) -> bool:
    """Whether a figure that the frame has may not be off at all."""
    return any(outcome.limits[name] == float(COMPARISON_METRICS[name].higher_is_better) for name in outcome.figures)


def verdict(comparison: Comparison) -> str:
    """In one line, with the level: `3 of 48 frames differ at cross-driver: 2 different, 1 missing`."""
    outcomes = comparison.outcomes
    level = f"{comparison.level} (with other limits)" if comparison.other_limits else comparison.level
    counts = Counter(outcome.status for outcome in outcomes)
    num, num_same = len(outcomes), counts["same"]
    if comparison.passes:
        everything = "The frame is" if num == 1 else f"All {num} frames are"
        if num_same == num:
            return f"{everything} the same, pixel by pixel"
        return f"{everything} within the limits of {level}" + (f", {num_same} of them the same" if num_same else "")
    if num == 1:
        return f"The frame differs at {level}: {outcomes[0].status}"
    failing = {status: counts[status] for status in sorted(counts) if status not in PASSES}
    kinds = ", ".join(f"{count} {status}" for status, count in failing.items())
    return f"{sum(failing.values())} of {num} frames differ at {level}" + (f": {kinds}" if len(failing) > 1 else "")


def _sides(comparison: Comparison) -> list[tuple[str, str, str, bool]]:
    """What it is about, what each side has there, and whether it should be the same and is not."""
    facts = [(name, golden, actual, golden != actual) for name, (golden, actual) in comparison.facts.items()]
    return [("compared", comparison.golden, comparison.actual, False), *facts]


# ------------------------------------------------------------------------------------------------------- worst frames


def _frames(gallery_frames: Sequence[GalleryFrame]) -> tuple[list[dict[str, Any]], int]:
    """What the template shows of each, worst first, and the bytes of all pictures; as many as there is room for."""
    frames: list[dict[str, Any]] = []
    num_bytes = 0
    for gallery_frame in gallery_frames:
        pictures = _pictures(gallery_frame)
        size = sum(len(picture["uri"]) for picture in pictures)
        if num_bytes + size > MAX_PICTURE_BYTES:
            break
        num_bytes += size
        outcome = gallery_frame.outcome
        frames.append(
            {
                "anchor": f"worst-{len(frames) + 1}",
                "name": outcome.name,
                "status": outcome.status,
                "why": outcome.why,
                "worst": gallery_frame.worst,
                "pictures": pictures,
                "flips": gallery_frame.overview.golden is not None and gallery_frame.overview.actual is not None,
                "pixels_per_side": gallery_frame.pixels_per_side,
                "figures": [_figure(outcome, name) for name in COMPARISON_METRICS if name in outcome.figures],
                "bias": list(zip(_CHANNELS, map(signed_text, outcome.bias), strict=False)),
            }
        )
    return frames, num_bytes


def _default_gain(gallery_frames: Sequence[GalleryFrame]) -> int:
    """The largest, if it tells the errors of all frames apart, else the one before it."""
    differences = [
        gallery_frame.overview.difference
        for gallery_frame in gallery_frames
        if gallery_frame.overview.difference is not None
    ]
    largest = max((int(difference.max()) for difference in differences), default=0)
    return GAINS[-1] if largest * GAINS[-1] <= 255 else GAINS[-2]


def _pictures(gallery_frame: GalleryFrame) -> list[dict[str, Any]]:
    """Golden, actual and difference, also those that there are not, and the same three enlarged."""
    outcome = gallery_frame.outcome
    alone = outcome.status in ("missing", "extra")
    absent = {
        "golden": "there is no such golden frame",
        "actual": "there is no such frame",
        "difference": "nothing to compare" if alone else f"none: {outcome.status}",
    }
    pictures = [
        _picture(kind, pixels, outcome.name, absent[kind]) for kind, pixels in vars(gallery_frame.overview).items()
    ]
    if gallery_frame.crop is None or gallery_frame.crop.golden is None:
        return pictures
    (x, y), (height, width, _) = gallery_frame.corner, gallery_frame.crop.golden.shape
    extent = f", enlarged: x {x} to {x + width - 1}, y {y} to {y + height - 1}"
    return pictures + [
        _picture(kind, pixels, outcome.name, "", extent) for kind, pixels in vars(gallery_frame.crop).items()
    ]


def _picture(kind: str, pixels: Pixels | None, name: str, absent: str, extent: str = "") -> dict[str, Any]:
    if pixels is None:
        return {"kind": kind, "uri": "", "caption": kind, "absent": absent}
    height, width, channels = pixels.shape
    times = max(1, _MIN_SHOWN_PX // max(height, width))
    return {
        "kind": kind,
        "uri": png_data_uri(pixels),
        "caption": f"{kind}{extent}",
        "alt": f"{kind} of {name}{extent}",
        "width": times * width,
        "height": times * height,
        "classes": " ".join([*["enlarged"] * (times > 1), *["transparent"] * (channels == 4)]),
    }


def _figure(outcome: Outcome, name: str) -> dict[str, Any]:
    figure, value, limit = COMPARISON_METRICS[name], outcome.figures[name], outcome.limits[name]
    return {
        "label": figure.label,
        "value": value_text(name, value, limit),
        "unit": figure.unit,
        "limit": limit_text(name, limit),
        "share": share_text(severity({name: value}, {name: limit})),
        "is_over": name in outcome.exceeded,
    }


# --------------------------------------------------------------------------------------------------------- all frames


def _row(outcome: Outcome, names: Sequence[str], number: int, anchor: str | None) -> dict[str, Any]:
    return {
        "name": outcome.name,
        "number": number,
        "anchor": anchor,
        "status": outcome.status,
        "passes": outcome.passes,
        "why": outcome.why,
        "cells": [_cell(outcome.severity, share_text(outcome.severity), is_over=False), *_figure_cells(outcome, names)],
    }


def _figure_cells(outcome: Outcome, names: Sequence[str]) -> Iterator[dict[str, Any]]:
    for name in names:
        value = outcome.figures.get(name)
        text = ABSENT if value is None else value_text(name, value, outcome.limits[name])
        yield _cell(value, text, is_over=name in outcome.exceeded)


def _cell(value: float | None, text: str, *, is_over: bool) -> dict[str, Any]:
    """The number that it sorts by as JavaScript reads it."""
    return {
        "value": "" if value is None else repr(float(value)).replace("inf", "Infinity"),
        "text": text,
        "is_over": is_over,
    }
