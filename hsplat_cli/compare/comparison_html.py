"""Renders a comparison as an HTML page: the verdict, the error over the frames, the worst frames, and all frames."""

from __future__ import annotations

import bisect
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import Image

from hsplat_cli.compare.frame_difference import COMPARISON_METRICS, FrameDifference
from hsplat_cli.compare.outcome import (
    Comparison,
    Outcome,
    Pair,
    limit_text,
    limits_text,
    share_text,
    signed_text,
    value_text,
)
from hsplat_cli.compare.strictness import STRICTNESSES, severity
from hsplat_cli.reports import Axis, Chart, Curve, Tick, bytes_text, png_data_uri, render_page, round_numbers
from renderer.film import Pixels

# Longest side of a picture, in pixels. Three pictures fit side by side on a wide screen without scaling, which would
# blend a single wrong pixel with its neighbours.
PICTURE_PX = 512
# Longest side of the enlarged crop around the pixel with the largest error, in pixels.
CROP_PX = 48
# Largest number of frames whose pictures the page shows if no frame fails.
NUM_PASSING_SHOWN = 6
# Largest size of all pictures on the page, in bytes. Incompressible pictures of a frame take 4 MB: seven frames fit.
MAX_PICTURE_BYTES = 30_000_000
# Factors by which a reader of the page can amplify the picture of the difference.
GAINS = (1, 10, 50)
# Width and height of the chart of errors, in pixels: as wide as it is shown on the page, so that texts are not scaled.
_SIZE = (864, 344)
# The length by which the axis of frame numbers extends beyond the first and the last frame, as a share of the length
# between these frames.
_MARGIN = 0.013
# Largest number of ticks on the axis of frame numbers.
_MOST_TICKS = 11
# Number of frames above which the chart marks each frame by a dot in place of a small circle.
_MIN_DENSE_FRAMES = 200
# Largest height of the chart above the limit, in powers of ten of the limit; larger errors are drawn at its top.
_MAX_DECADES = 4
# Colour and dashes of each metric's curve in the chart of errors; the colour series-2 is left out, because it marks
# failures.
_STYLES = (
    ("series-1", "none"),
    ("series-3", "7 3"),
    ("series-4", "2 3"),
    ("series-5", "10 3 2 3"),
    ("series-6", "5 5"),
    ("series-8", "1 5"),
)
_CAPTION = (
    "Linear up to the limit, logarithmic above; with a limit of no error, an error of n steps, or of n hundredths in "
    "FLIP and SSIM, counts as 1 + n. A cross marks a frame that fails."
)

_Steps = npt.NDArray[np.float32]


def comparison_page(comparison: Comparison, gallery: Gallery) -> str:
    """Return the HTML page of a comparison; equal comparisons and pictures give equal pages."""
    outcomes = comparison.outcomes
    frames, num_bytes, largest = [], 0, 0
    for frame in gallery.gallery_frames:  # worst first, as many as fit
        uris = ["" if picture.pixels is None else png_data_uri(picture.pixels) for picture in frame.pictures]
        if num_bytes + sum(map(len, uris)) > MAX_PICTURE_BYTES:
            break
        num_bytes += sum(map(len, uris))
        frames.append((frame, list(zip(frame.pictures, uris, strict=True))))
        difference = frame.pictures[2].pixels
        largest = max(largest, 0 if difference is None else int(difference.max()))
    return render_page(
        "compare.html",
        title=comparison.summary,
        comparison=comparison,
        purpose=STRICTNESSES[comparison.level].purpose,
        plot=_plot_errors(comparison),
        frames=frames,
        anchors={frame.outcome.name: f"worst-{number}" for number, (frame, _) in enumerate(frames, 1)},
        order={outcome.name: number for number, outcome in enumerate(outcomes)},
        size=bytes_text(num_bytes),
        picture_px=PICTURE_PX,
        gains=GAINS,
        # The page opens with the gain of 50 unless it clips an error, else with the gain of 10.
        default_gain=GAINS[-1] if largest * GAINS[-1] <= 255 else GAINS[-2],
        metrics=[metric for name, metric in COMPARISON_METRICS.items() if any(name in o.figures for o in outcomes)],
        value_text=value_text,
        limit_text=limit_text,
        share_text=share_text,
        bias_lines=lambda bias: zip(("red", "green", "blue", "alpha"), map(signed_text, bias), strict=False),
        severity=severity,
    )


# The chart of errors


def _plot_errors(comparison: Comparison) -> Chart:
    """Return the chart of each metric over the frames, as a share of the metric's limit.

    Heights are linear up to the limit and logarithmic above it, so that both near misses and large errors are legible.
    """
    outcomes = comparison.outcomes
    names = [name for name in COMPARISON_METRICS if any(name in outcome.figures for outcome in outcomes)]
    numbers = [comparison.frame_numbers.get(outcome.name, place) for place, outcome in enumerate(outcomes, 1)]
    first, last = min(numbers), max(numbers)
    largest = max(severity(outcome.figures, outcome.limits) for outcome in outcomes)
    decades = min(max(math.ceil(math.log10(max(largest, 1.0))), 1), _MAX_DECADES)

    def height(outcome: Outcome, name: str) -> float:
        share = severity({name: outcome.figures[name]}, outcome.limits)
        return share if share <= 1 else 1 + min(math.log10(share), decades)

    metrics = ", ".join(COMPARISON_METRICS[name].label for name in names)
    margin = _MARGIN * (last - first) or 0.5
    ticks = [Tick(at, f"{at:g}") for at in round_numbers(first, last, _MOST_TICKS, least_step=1)]
    limits = [Tick(0, "0"), Tick(0.5, "0.5"), Tick(1, "1", "limit")]
    powers = [Tick(1 + power, f"{10**power:,}".replace(",", " ")) for power in range(1, decades + 1)]
    title = "frame number" if comparison.frame_numbers else "place of the frame in the order of names"
    return Chart(
        Axis(title, first - margin, last + margin, ticks),
        Axis("error, times its limit", 0, 1 + decades, [*limits, *powers]),
        [
            Curve(
                limits_text(name, [o.limits[name] for o in outcomes if name in o.limits]),
                [(x, height(o, name)) if name in o.figures else None for x, o in zip(numbers, outcomes, strict=True)],
                color,
                "dot" if len(outcomes) > _MIN_DENSE_FRAMES else "small circle",
                dash,
            )
            for name, (color, dash) in zip(names, _STYLES, strict=False)
        ],
        _CAPTION,
        f"Errors of {len(outcomes)} frames as shares of their limits; {comparison.num_failing} frames fail: {metrics}",
        marks=[(x, f"{o.name}: {o.why}") for x, o in zip(numbers, outcomes, strict=True) if not o.passes],
        size=_SIZE,
    )


# The pictures of the worst frames


class GalleryPicture(NamedTuple):
    """Holds a picture of a frame, or of the difference of both sides.

    kind: `golden`, `actual` or `difference`.
    pixels: of the kinds `golden` and `actual`, uint8 [h, w, 3 or 4]; None for a side without the frame. Of the kind
        `difference`, uint8 [h, w, 3]: red and blue are the grey steps, rounded up, by which the most different channel
        of a pixel is brighter or darker than in the golden, and green is 0; None if nothing can be compared.
    extent: a text on the part of the frame that is shown; empty for the whole frame.
    """

    kind: str
    pixels: Pixels | None
    extent: str = ""


@dataclass(frozen=True)
class GalleryFrame:
    """Holds the pictures of a frame on the page.

    pictures: golden, actual and difference, reduced to at most PICTURE_PX pixels along a side; then the crops of
    CROP_PX pixels around the worst pixel, unless the frame is small or nothing can be compared.
    pixels_per_side: a pixel of a reduced picture stands for a block of this many frame pixels along each side; golden
    and actual show the block's mean, the difference its largest error.
    worst: (x, y) of the first frame pixel with the largest error; None if nothing can be compared.
    """

    outcome: Outcome
    pictures: Sequence[GalleryPicture]
    pixels_per_side: int
    worst: tuple[int, int] | None = None


class Gallery:
    """Collects the pictures of the worst `max_frames` frames that differ from their goldens."""

    def __init__(self, max_frames: int = 24) -> None:
        self._max_frames = max_frames
        self._frames: list[GalleryFrame] = []  # sorted, worst first

    def add(self, outcome: Outcome, pair: Pair) -> None:
        """Add a frame; among frames of equal rank, the earlier one comes first."""
        is_full = len(self._frames) == self._max_frames
        if outcome.status == "same" or (is_full and outcome.rank >= self._frames[-1].outcome.rank):
            return
        bisect.insort(self._frames, _make_gallery_frame(outcome, pair), key=lambda frame: frame.outcome.rank)
        del self._frames[self._max_frames :]

    @property
    def gallery_frames(self) -> list[GalleryFrame]:
        """Return the failing frames, worst first; if none fails, NUM_PASSING_SHOWN frames closest to their limits."""
        failing = [frame for frame in self._frames if not frame.outcome.passes]
        return failing or self._frames[:NUM_PASSING_SHOWN]


def _make_gallery_frame(outcome: Outcome, pair: Pair) -> GalleryFrame:
    golden, actual = pair.golden, pair.actual
    sizes = [length for picture in (golden, actual) if picture is not None for length in picture.shape[:2]]
    side = -(-max(sizes) // PICTURE_PX)
    sides = [GalleryPicture("golden", _means(golden, side)), GalleryPicture("actual", _means(actual, side))]
    if golden is None or actual is None or golden.shape != actual.shape:
        return GalleryFrame(outcome, [*sides, GalleryPicture("difference", None)], side)
    steps = FrameDifference(golden, actual).signed_steps
    pictures = [*sides, GalleryPicture("difference", _difference_picture(_largest(steps, side)))]
    y, x = (int(place) for place in np.unravel_index(np.abs(steps).argmax(), steps.shape))
    if max(steps.shape) > 2 * CROP_PX:
        height, width = steps.shape
        top, left = (max(min(at - CROP_PX // 2, num - CROP_PX), 0) for at, num in ((y, height), (x, width)))
        bottom, right = min(top + CROP_PX, height), min(left + CROP_PX, width)
        extent = f", enlarged: x {left} to {right - 1}, y {top} to {bottom - 1}"
        pictures += [
            # Copied, because a view of a part would keep the whole frame in memory.
            GalleryPicture("golden", golden[top:bottom, left:right].copy(), extent),
            GalleryPicture("actual", actual[top:bottom, left:right].copy(), extent),
            GalleryPicture("difference", _difference_picture(steps[top:bottom, left:right]), extent),
        ]
    return GalleryFrame(outcome, pictures, side, (x, y))


def _difference_picture(steps: _Steps) -> Pixels:
    picture = np.zeros((*steps.shape, 3), np.uint8)
    picture[..., 0] = np.ceil(np.maximum(steps, 0))
    picture[..., 2] = np.ceil(np.maximum(-steps, 0))
    return picture


def _largest(steps: _Steps, side: int) -> _Steps:
    """Return the value furthest from 0 of each block of `side` x `side` pixels."""
    height, width = steps.shape
    padded = np.pad(steps, ((0, -height % side), (0, -width % side)), mode="edge")
    blocks = padded.reshape(padded.shape[0] // side, side, padded.shape[1] // side, side)
    highest, lowest = blocks.max(axis=(1, 3)), blocks.min(axis=(1, 3))
    return np.asarray(np.where(highest >= -lowest, highest, lowest), np.float32)


def _means(picture: Pixels | None, side: int) -> Pixels | None:
    """Return the mean of each block of `side` x `side` pixels, with colours weighted by alpha."""
    return None if picture is None else np.asarray(Image.fromarray(picture).reduce(side))
