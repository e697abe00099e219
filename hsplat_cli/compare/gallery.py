"""Keep the pictures of the worst frames for the page."""

from __future__ import annotations

import bisect
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from PIL import Image

from hsplat_cli.compare.outcome import Outcome, Pair
from renderer.film import Pixels
from renderer.study import FrameDifference

# Longest side of a picture. Three fit side by side on a wide screen without scaling, which would blend a single wrong
# pixel with its neighbours.
PICTURE_PX = 512
# Longest side of the enlarged crop around the pixel with the largest error.
CROP_PX = 48
# Number of frames shown, of those that pass but are not the same, if no frame fails.
NUM_PASSING_SHOWN = 6

_Levels = npt.NDArray[np.float32]


class GalleryPicture(NamedTuple):
    """A picture of a frame.

    kind: `golden` and `actual` are uint8 [h, w, 3 or 4], None for a side without the frame. `difference` is uint8
    [h, w, 3], None if nothing can be compared: red and blue are the levels, rounded up, by which the most different
    channel of a pixel is brighter or darker than in the golden; green is 0.
    extent: words on the part of the frame that is shown; empty for all of it.
    """

    kind: str
    pixels: Pixels | None
    extent: str = ""


@dataclass(frozen=True)
class GalleryFrame:
    """A frame on the page.

    pictures: golden, actual and difference, at most PICTURE_PX wide and high, and the same of CROP_PX pixels around the
    worst one, unless the frame is small or nothing can be compared.
    pixels_per_side: side of the block of frame pixels behind each pixel of the former; golden and actual show the
    block's mean, the difference its largest error.
    worst: (x, y) of the first frame pixel with the largest error; None if nothing can be compared.
    """

    outcome: Outcome
    pictures: Sequence[GalleryPicture]
    pixels_per_side: int
    worst: tuple[int, int] | None = None


class Gallery:
    """Collects the pictures of the worst `max_frames` frames, of those that are not the same."""

    def __init__(self, max_frames: int = 24) -> None:
        self._max_frames = max_frames
        self._frames: list[GalleryFrame] = []  # sorted, worst first

    def add(self, outcome: Outcome, pair: Pair) -> None:
        """Add a frame; of equal ranks the earlier one comes first."""
        is_full = len(self._frames) == self._max_frames
        if outcome.status == "same" or (is_full and outcome.rank >= self._frames[-1].outcome.rank):
            return
        bisect.insort(self._frames, _make_gallery_frame(outcome, pair), key=lambda frame: frame.outcome.rank)
        del self._frames[self._max_frames :]

    @property
    def gallery_frames(self) -> list[GalleryFrame]:
        """Return the failing frames, worst first; if none fails, the NUM_PASSING_SHOWN closest to their limits."""
        failing = [frame for frame in self._frames if not frame.outcome.passes]
        return failing or self._frames[:NUM_PASSING_SHOWN]


def _make_gallery_frame(outcome: Outcome, pair: Pair) -> GalleryFrame:
    golden, actual = pair.golden, pair.actual
    sizes = [length for picture in (golden, actual) if picture is not None for length in picture.shape[:2]]
    side = -(-max(sizes) // PICTURE_PX)
    sides = [GalleryPicture("golden", _means(golden, side)), GalleryPicture("actual", _means(actual, side))]
    if golden is None or actual is None or golden.shape != actual.shape:
        return GalleryFrame(outcome, [*sides, GalleryPicture("difference", None)], side)
    levels = FrameDifference(golden, actual).signed_levels
    pictures = [*sides, GalleryPicture("difference", _difference_picture(_largest(levels, side)))]
    y, x = (int(place) for place in np.unravel_index(np.abs(levels).argmax(), levels.shape))
    if max(levels.shape) > 2 * CROP_PX:
        height, width = levels.shape
        top, left = (max(min(at - CROP_PX // 2, num - CROP_PX), 0) for at, num in ((y, height), (x, width)))
        bottom, right = min(top + CROP_PX, height), min(left + CROP_PX, width)
        extent = f", enlarged: x {left} to {right - 1}, y {top} to {bottom - 1}"
        pictures += [
            # A view would keep the whole frame in memory.
            GalleryPicture("golden", golden[top:bottom, left:right].copy(), extent),
            GalleryPicture("actual", actual[top:bottom, left:right].copy(), extent),
            GalleryPicture("difference", _difference_picture(levels[top:bottom, left:right]), extent),
        ]
    return GalleryFrame(outcome, pictures, side, (x, y))


def _difference_picture(levels: _Levels) -> Pixels:
    picture = np.zeros((*levels.shape, 3), np.uint8)
    picture[..., 0] = np.ceil(np.maximum(levels, 0))
    picture[..., 2] = np.ceil(np.maximum(-levels, 0))
    return picture


def _largest(levels: _Levels, side: int) -> _Levels:
    """Return the value furthest from 0 of each block of `side` x `side` pixels."""
    height, width = levels.shape
    padded = np.pad(levels, ((0, -height % side), (0, -width % side)), mode="edge")
    blocks = padded.reshape(padded.shape[0] // side, side, padded.shape[1] // side, side)
    highest, lowest = blocks.max(axis=(1, 3)), blocks.min(axis=(1, 3))
    return np.asarray(np.where(highest >= -lowest, highest, lowest), np.float32)


def _means(picture: Pixels | None, side: int) -> Pixels | None:
    """Return the mean of each block of `side` x `side` pixels, with colours weighted by alpha."""
    return None if picture is None else np.asarray(Image.fromarray(picture).reduce(side))
