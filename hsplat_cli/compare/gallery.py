"""The pictures of the worst frames, of as many frames as there may be, for the page."""

from __future__ import annotations

import bisect
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hsplat_cli.compare.outcome import Outcome
from hsplat_cli.compare.pair import Pair, Pixels
from renderer.study import FrameDifference

# The longest side of a picture. Three of them fit side by side on a wide screen without being scaled down there, which
# would blend a single wrong pixel with those around it.
PICTURE_PX = 512
# The longest side of what is shown enlarged: what is around the pixel that is most off.
CROP_PX = 48
# How many of the frames that pass, but are not the same, are shown where none fails.
NUM_PASSING_SHOWN = 6

_Levels = npt.NDArray[np.float32]


@dataclass(frozen=True)
class ImageTriple:
    """golden, actual: uint8 [h, w, 3 or 4]; None where one side has no such frame.

    difference: uint8 [h, w, 3]: red, the levels by which the most different channel of a pixel is brighter than in the
    golden, and blue, those by which it is darker, rounded up; green is 0. None where nothing can be compared.
    """

    golden: Pixels | None
    actual: Pixels | None
    difference: Pixels | None


@dataclass(frozen=True)
class GalleryFrame:
    """A frame that is shown.

    whole: at most PICTURE_PX wide and high. pixels_per_side: how many of the frame's pixels a pixel of it is wide and
    high; golden and actual have their means, the difference the largest of them.
    worst: (x, y) of the frame's pixel that is most off, the first of them; None where nothing can be compared.
    detail: what is around that pixel, CROP_PX wide and high, or as far as the frame goes; None where the frame is
    little larger, or nothing can be compared. corner: (x, y) of the detail's first pixel.
    """

    outcome: Outcome
    overview: ImageTriple
    pixels_per_side: int
    worst: tuple[int, int] | None = None
    crop: ImageTriple | None = None
    corner: tuple[int, int] = (0, 0)


class Gallery:
    """Looks at every frame and keeps the pictures of the worst `most` ones, of those that are not the same."""

    def __init__(self, max_frames: int = 24) -> None:
        self._max_frames = max_frames
        self._frames: list[tuple[tuple[bool, float, int], GalleryFrame]] = []  # sorted, worst first
        self._num_added = 0

    def add(self, outcome: Outcome, pair: Pair) -> None:
        """Frames of one rank go by the order in which they are seen."""
        place = (*outcome.rank, self._num_added)
        self._num_added += 1
        if outcome.status == "same" or (len(self._frames) == self._max_frames and place > self._frames[-1][0]):
            return
        bisect.insort(
            self._frames, (place, _make_gallery_frame(outcome, pair))
        )  # places are unique: exhibits are never compared
        del self._frames[self._max_frames :]

    @property
    def gallery_frames(self) -> list[GalleryFrame]:
        """Those that fail, worst first; where none does, the NUM_PASSING_SHOWN that came nearest to it."""
        gallery_frames = [gallery_frame for _, gallery_frame in self._frames]
        return [
            gallery_frame for gallery_frame in gallery_frames if not gallery_frame.outcome.passes
        ] or gallery_frames[:NUM_PASSING_SHOWN]


def _make_gallery_frame(outcome: Outcome, pair: Pair) -> GalleryFrame:
    golden, actual = pair.golden, pair.actual
    shapes = [picture.shape for picture in (golden, actual) if picture is not None]
    side = -(-max(length for height, width, _ in shapes for length in (height, width)) // PICTURE_PX)
    small, other = (None if picture is None else _means(picture, side) for picture in (golden, actual))
    if golden is None or actual is None or golden.shape != actual.shape:
        return GalleryFrame(outcome, ImageTriple(small, other, None), side)
    levels = FrameDifference(golden, actual).signed_levels
    overview = ImageTriple(small, other, _difference_picture(_largest(levels, side)))
    y, x = (int(place) for place in np.unravel_index(np.abs(levels).argmax(), levels.shape))
    if max(levels.shape) <= 2 * CROP_PX:
        return GalleryFrame(outcome, overview, side, (x, y))
    rows, columns = (_crop_range(place, length) for place, length in zip((y, x), levels.shape, strict=True))
    # Copies: a view would keep all of a large frame in memory.
    around = golden[rows, columns].copy(), actual[rows, columns].copy()
    crop = ImageTriple(*around, _difference_picture(levels[rows, columns]))
    return GalleryFrame(outcome, overview, side, (x, y), crop, (columns.start, rows.start))


def _crop_range(place: int, length: int) -> slice:
    """CROP_PX of a length, or all of it, as nearly around a place as they are inside."""
    start = min(max(place - CROP_PX // 2, 0), max(length - CROP_PX, 0))
    return slice(start, min(start + CROP_PX, length))


def _difference_picture(levels: _Levels) -> Pixels:
    picture = np.zeros((*levels.shape, 3), np.uint8)
    picture[..., 0] = np.ceil(np.maximum(levels, 0))
    picture[..., 2] = np.ceil(np.maximum(-levels, 0))
    return picture


def _largest(levels: _Levels, side: int) -> _Levels:
    """Of blocks of `side` x `side` pixels, the one that is furthest from 0, with its sign."""
    blocks = _blocks(levels[..., None], side)
    highest, lowest = blocks.max(axis=(1, 3))[..., 0], blocks.min(axis=(1, 3))[..., 0]
    return np.asarray(np.where(highest >= -lowest, highest, lowest), np.float32)


def _means(picture: Pixels, side: int) -> Pixels:
    """Over blocks of `side` x `side` pixels; colours count as much as they are opaque."""
    if side == 1:
        return picture
    values = picture.astype(np.float32)
    if picture.shape[2] == 4:
        values[..., :3] *= values[..., 3:]
    means = _blocks(values, side).mean(axis=(1, 3))
    if picture.shape[2] == 4:
        means[..., :3] /= np.where(means[..., 3:] > 0, means[..., 3:], 1)
    return np.asarray(np.floor(means.clip(0, 255) + 0.5), np.uint8)


def _blocks(values: _Levels, side: int) -> _Levels:
    """[h, side, w, side, c] of [height, width, c]; what is missing of the last ones is as at the border."""
    height, width, channels = values.shape
    padded = np.pad(values, ((0, -height % side), (0, -width % side), (0, 0)), mode="edge")
    return padded.reshape(padded.shape[0] // side, side, padded.shape[1] // side, side, channels)
