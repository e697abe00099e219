"""The pictures of the worst frames, of as many frames as there may be, for the page."""

from __future__ import annotations

import bisect
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from hsplat_cli.compare.outcome import Outcome
from hsplat_cli.compare.pair import Pair, Pixels
from renderer.frame_difference import FrameDifference

# The longest side of a picture. Three of them fit side by side on a wide screen without being scaled down there, which
# would blend a single wrong pixel with those around it.
PICTURE_PX = 512
# How many of the frames that pass, but are not the same, are shown where none fails.
FEW = 6


@dataclass(frozen=True)
class Exhibit:
    """A frame that is shown.

    golden, actual: uint8 [h, w, 3 or 4], at most PICTURE_PX wide and high; None where one side has no such frame.
    difference: uint8 [h, w, 3]: red, the levels by which the most different channel of a pixel is brighter than in
        the golden, and blue, those by which it is darker, rounded up; green is 0. None where nothing can be compared.
    pixels_per_side: how many of the frame's pixels a pixel of these is wide and high: golden and actual have means,
        the difference the largest.
    """

    outcome: Outcome
    golden: Pixels | None
    actual: Pixels | None
    difference: Pixels | None
    pixels_per_side: int


class Gallery:
    """Looks at every frame and keeps the pictures of the worst `most` ones, of those that are not the same."""

    def __init__(self, most: int = 24) -> None:
        self._most = most
        self._kept: list[tuple[tuple[bool, float, float, int], Exhibit]] = []  # sorted, worst first
        self._num_seen = 0

    def see(self, outcome: Outcome, pair: Pair) -> None:
        """Frames of one rank go by the order in which they are seen."""
        place = (*outcome.rank, self._num_seen)
        self._num_seen += 1
        if outcome.status == "same" or (len(self._kept) == self._most and place > self._kept[-1][0]):
            return
        bisect.insort(self._kept, (place, _exhibit(outcome, pair)))  # places are unique: exhibits are never compared
        del self._kept[self._most :]

    @property
    def exhibits(self) -> list[Exhibit]:
        """Those that fail, worst first; where none does, the FEW that came nearest to it."""
        exhibits = [exhibit for _, exhibit in self._kept]
        return [exhibit for exhibit in exhibits if not exhibit.outcome.passes] or exhibits[:FEW]


def _exhibit(outcome: Outcome, pair: Pair) -> Exhibit:
    golden, actual = pair.golden, pair.actual
    pictures = [picture for picture in (golden, actual) if picture is not None]
    side = -(-max(max(picture.shape[:2]) for picture in pictures) // PICTURE_PX)
    difference = None
    if golden is not None and actual is not None and golden.shape == actual.shape:
        difference = _difference_picture(golden, actual, side)
    return Exhibit(
        outcome,
        None if golden is None else _means(golden, side),
        None if actual is None else _means(actual, side),
        difference,
        side,
    )


def _difference_picture(golden: Pixels, actual: Pixels, side: int) -> Pixels:
    blocks = _blocks(FrameDifference(golden, actual).signed_levels[..., None], side)
    brighter, darker = blocks.max(axis=(1, 3)), -blocks.min(axis=(1, 3))
    levels = np.where(brighter >= darker, brighter, -darker)[..., 0]
    picture = np.zeros((*levels.shape, 3), np.uint8)
    picture[..., 0] = np.ceil(np.maximum(levels, 0))
    picture[..., 2] = np.ceil(np.maximum(-levels, 0))
    return picture


def _means(picture: Pixels, side: int) -> Pixels:
    """Over blocks of `side` x `side` pixels; colours count as much as they are opaque."""
    if side == 1:
        return picture
    values = picture / 255
    if picture.shape[2] == 4:
        values[..., :3] *= values[..., 3:]
    means = _blocks(values, side).mean(axis=(1, 3))
    if picture.shape[2] == 4:
        means[..., :3] /= np.where(means[..., 3:] > 0, means[..., 3:], 1)
    return np.floor(means.clip(0, 1) * 255 + 0.5).astype(np.uint8)


def _blocks(values: npt.NDArray[np.floating], side: int) -> npt.NDArray[np.floating]:
    """[h, side, w, side, c] of [height, width, c]; what is missing of the last ones is as at the border."""
    height, width, channels = values.shape
    padded = np.pad(values, ((0, -height % side), (0, -width % side), (0, 0)), mode="edge")
    return padded.reshape(padded.shape[0] // side, side, padded.shape[1] // side, side, channels)
