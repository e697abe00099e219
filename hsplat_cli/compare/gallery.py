"""Keep the pictures of the worst frames for the page."""

from __future__ import annotations

import bisect
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hsplat_cli.compare.outcome import Outcome
from hsplat_cli.compare.pair import Pair
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


@dataclass(frozen=True)
class ImageTriple:
    """Golden and actual picture, uint8 [h, w, 3 or 4], None for a side without the frame, and their difference.

    difference: uint8 [h, w, 3]: red and blue are the levels, rounded up, by which the most different channel of a pixel
    is brighter or darker than in the golden; green is 0. None if nothing can be compared.
    """

    golden: Pixels | None
    actual: Pixels | None
    difference: Pixels | None


@dataclass(frozen=True)
class GalleryFrame:
    """A frame on the page.

    overview: at most PICTURE_PX wide and high. pixels_per_side: side of the block of frame pixels behind each of its
    pixels; golden and actual show the block's mean, the difference its largest error.
    worst: (x, y) of the first frame pixel with the largest error; None if nothing can be compared.
    crop: CROP_PX pixels around the worst one, within the frame; None for a small frame or if nothing can be compared.
    corner: (x, y) of the crop's first pixel.
    """

    outcome: Outcome
    overview: ImageTriple
    pixels_per_side: int
    worst: tuple[int, int] | None = None
    crop: ImageTriple | None = None
    corner: tuple[int, int] = (0, 0)


class Gallery:
    """Collects the pictures of the worst `max_frames` frames, of those that are not the same."""

    def __init__(self, max_frames: int = 24) -> None:
        self._max_frames = max_frames
        self._frames: list[tuple[tuple[bool, float, int], GalleryFrame]] = []  # sorted, worst first
        self._num_added = 0

    def add(self, outcome: Outcome, pair: Pair) -> None:
        """Add a frame; of equal ranks the earlier one comes first."""
        rank = (*outcome.rank, self._num_added)
        self._num_added += 1
        if outcome.status == "same" or (len(self._frames) == self._max_frames and rank > self._frames[-1][0]):
            return
        # Ranks are unique, so that frames are never compared.
        bisect.insort(self._frames, (rank, _make_gallery_frame(outcome, pair)))
        del self._frames[self._max_frames :]

    @property
    def gallery_frames(self) -> list[GalleryFrame]:
        """The failing frames, worst first; if none fails, the NUM_PASSING_SHOWN closest to their limits."""
        frames = [frame for _, frame in self._frames]
        return [frame for frame in frames if not frame.outcome.passes] or frames[:NUM_PASSING_SHOWN]


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
    # A view would keep the whole frame in memory.
    around = golden[rows, columns].copy(), actual[rows, columns].copy()
    crop = ImageTriple(*around, _difference_picture(levels[rows, columns]))
    return GalleryFrame(outcome, overview, side, (x, y), crop, (columns.start, rows.start))


def _crop_range(place: int, length: int) -> slice:
    """Return CROP_PX positions around a place, moved to lie within the length."""
    start = min(max(place - CROP_PX // 2, 0), max(length - CROP_PX, 0))
    return slice(start, min(start + CROP_PX, length))


def _difference_picture(levels: _Levels) -> Pixels:
    picture = np.zeros((*levels.shape, 3), np.uint8)
    picture[..., 0] = np.ceil(np.maximum(levels, 0))
    picture[..., 2] = np.ceil(np.maximum(-levels, 0))
    return picture


def _largest(levels: _Levels, side: int) -> _Levels:
    """Return the value furthest from 0 of each block of `side` x `side` pixels."""
    blocks = _blocks(levels[..., None], side)
    highest, lowest = blocks.max(axis=(1, 3))[..., 0], blocks.min(axis=(1, 3))[..., 0]
    return np.asarray(np.where(highest >= -lowest, highest, lowest), np.float32)


def _means(picture: Pixels, side: int) -> Pixels:
    """Return the mean of each block of `side` x `side` pixels, with colours weighted by alpha."""
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
    """Return [h, side, w, side, c] of [height, width, c], padded by its border."""
    height, width, channels = values.shape
    padded = np.pad(values, ((0, -height % side), (0, -width % side), (0, 0)), mode="edge")
    return padded.reshape(padded.shape[0] // side, side, padded.shape[1] // side, side, channels)
