"""Render a comparison as an HTML page: the verdict, the error over the frames, the worst frames, and all frames."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from hsplat_cli.compare.error_plot import plot_errors
from hsplat_cli.compare.figure_format import limit_text, printable, share_text, signed_text, value_text
from hsplat_cli.compare.gallery import PICTURE_PX, Gallery, GalleryFrame
from hsplat_cli.compare.outcome import PASSES, Comparison, Outcome
from hsplat_cli.reports import bytes_text, png_data_uri, render_page
from renderer.film import Pixels
from renderer.study import COMPARISON_METRICS, STRICTNESS_LEVELS, severity

# Limits the size of all pictures on the page. Incompressible pictures of a frame take 4 MB: seven frames always fit.
MAX_PICTURE_BYTES = 30_000_000
GAINS = (1, 10, 50)
# Smaller pictures are enlarged by whole pixels up to this size.
_MIN_SHOWN_PX = 384
_CHANNELS = ("red", "green", "blue", "alpha")


def comparison_page(comparison: Comparison, gallery: Gallery) -> str:
    """Return the page as text; equal comparisons and pictures give equal text. Needs the package jinja2."""
    frames, num_bytes = _shown_frames(gallery.gallery_frames)
    outcomes = comparison.outcomes
    differences = [frame.overview.difference for frame in gallery.gallery_frames]
    largest = max((int(levels.max()) for levels in differences if levels is not None), default=0)
    text = render_page(
        "compare.html",
        title=verdict(comparison),
        comparison=comparison,
        purpose=STRICTNESS_LEVELS[comparison.level].purpose,
        plot=plot_errors(comparison),
        frames=frames,
        anchors={frame["outcome"].name: frame["anchor"] for frame in frames},
        order={outcome.name: number for number, outcome in enumerate(outcomes)},
        num_failing=sum(not outcome.passes for outcome in outcomes),
        size=bytes_text(num_bytes),
        picture_px=PICTURE_PX,
        gains=GAINS,
        default_gain=GAINS[-1] if largest * GAINS[-1] <= 255 else GAINS[-2],  # tells the errors of all frames apart
        metrics=[metric for name, metric in COMPARISON_METRICS.items() if any(name in o.figures for o in outcomes)],
        has_zero_limit=any(map(_has_zero_limit, outcomes)),
        value_text=value_text,
        share_text=share_text,
    )
    # File names may hold any bytes, also invalid UTF-8.
    return "\n".join(line if line.isprintable() else printable(line) for line in text.split("\n"))


def _has_zero_limit(outcome: Outcome) -> bool:
    """Return whether a metric of the frame must have no error at all."""
    return any(outcome.limits[name] == float(COMPARISON_METRICS[name].higher_is_better) for name in outcome.figures)


def verdict(comparison: Comparison) -> str:
    """Return the verdict in one line: `3 of 48 frames differ at cross-driver: 2 different, 1 missing`."""
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


def _shown_frames(gallery_frames: Sequence[GalleryFrame]) -> tuple[list[dict[str, Any]], int]:
    """Return the template's values for each frame that fits, worst first, and the bytes of their pictures."""
    frames: list[dict[str, Any]] = []
    num_bytes = 0
    for frame in gallery_frames:
        pictures = _pictures(frame)
        size = sum(len(picture["uri"]) for picture in pictures)
        if num_bytes + size > MAX_PICTURE_BYTES:
            break
        num_bytes += size
        outcome = frame.outcome
        frames.append(
            {
                "anchor": f"worst-{len(frames) + 1}",
                "outcome": outcome,
                "gallery_frame": frame,
                "pictures": pictures,
                "flips": frame.overview.golden is not None and frame.overview.actual is not None,
                "figures": [_figure_line(outcome, name) for name in COMPARISON_METRICS if name in outcome.figures],
                "bias": list(zip(_CHANNELS, map(signed_text, outcome.bias), strict=False)),
            }
        )
    return frames, num_bytes


def _figure_line(outcome: Outcome, name: str) -> tuple[bool, tuple[str, str, str, str, str]]:
    """Return whether a metric is over its limit, and label, value, unit, limit and share of the limit."""
    metric, value, limit = COMPARISON_METRICS[name], outcome.figures[name], outcome.limits[name]
    share = share_text(severity({name: value}, {name: limit}))
    texts = (metric.label, value_text(name, value, limit), metric.unit, limit_text(name, limit), share)
    return name in outcome.exceeded, texts


def _pictures(frame: GalleryFrame) -> list[dict[str, Any]]:
    """Return golden, actual and difference, absent ones included, and the same three as crops."""
    outcome = frame.outcome
    alone = outcome.status in ("missing", "extra")
    absent = {
        "golden": "no such golden frame",
        "actual": "no such actual frame",
        "difference": "nothing to compare" if alone else f"none: {outcome.status}",
    }
    pictures = [_picture(kind, pixels, outcome.name, absent[kind], "") for kind, pixels in vars(frame.overview).items()]
    if frame.crop is None or frame.crop.golden is None:
        return pictures
    (x, y), (height, width, _) = frame.corner, frame.crop.golden.shape
    extent = f", enlarged: x {x} to {x + width - 1}, y {y} to {y + height - 1}"
    return pictures + [_picture(kind, pixels, outcome.name, "", extent) for kind, pixels in vars(frame.crop).items()]


def _picture(kind: str, pixels: Pixels | None, name: str, absent: str, extent: str) -> dict[str, Any]:
    if pixels is None:
        return {"kind": kind, "uri": "", "caption": kind, "absent": absent}
    height, width, channels = pixels.shape
    scale = max(1, _MIN_SHOWN_PX // max(height, width))
    return {
        "kind": kind,
        "uri": png_data_uri(pixels),
        "caption": f"{kind}{extent}",
        "alt": f"{kind} of {name}{extent}",
        "width": scale * width,
        "height": scale * height,
        "classes": " ".join([*["enlarged"] * (scale > 1), *["transparent"] * (channels == 4)]),
    }
