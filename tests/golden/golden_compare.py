"""Whether two frames look the same, and pictures of where they do not."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import numpy.typing as npt

Image = npt.NDArray[np.uint8]

# llvmpipe draws the same bytes with vectors of 128 and 256 bits and any number of threads. Mesa's softpipe, which has
# other arithmetic, comes to 1 level and 0.01, but for one splat that is cut by the near plane (5 levels, where llvmpipe
# is within 0.005 of the reference). Between processors others have seen up to 3 levels. A channel that is wrong by one
# part in a hundred makes 0.33 and more wherever its level is above 100.
LARGEST = 3
DENSEST = 0.3
WINDOW_PX = 8

AMPLIFICATION = 20


@dataclass(frozen=True)
class Difference:
    """Between two frames, in levels of 255.

    largest: at any pixel, in any channel.
    densest: the largest mean over all channels of a square of WINDOW_PX pixels: what many small differences add up to
        where they are close together.
    """

    largest: int
    densest: float

    @property
    def is_visible(self) -> bool:
        """Whether it is more than another machine may make."""
        return self.largest > LARGEST or self.densest > DENSEST

    def __str__(self) -> str:
        return (
            f"largest difference {self.largest} (at most {LARGEST}), densest {self.densest:.2f} (at most {DENSEST})"
            " levels of 255"
        )


def compare(golden: Image, actual: Image) -> Difference:
    """The difference of two frames of one shape, [h, w, 3 or 4]; colours count as much as they are opaque."""
    assert golden.shape == actual.shape, f"{golden.shape} and {actual.shape}"
    levels = abs(_premultiplied(golden) - _premultiplied(actual))
    sums = np.pad(levels.mean(axis=2).cumsum(axis=0).cumsum(axis=1), ((1, 0), (1, 0)))
    windows = (
        sums[WINDOW_PX:, WINDOW_PX:] - sums[:-WINDOW_PX, WINDOW_PX:] - sums[WINDOW_PX:, :-WINDOW_PX]
        + sums[:-WINDOW_PX, :-WINDOW_PX]
    )  # fmt: skip
    return Difference(round(float(levels.max())), float(windows.max()) / WINDOW_PX**2)


def _premultiplied(image: Image) -> npt.NDArray[np.float64]:
    values = image.astype(np.float64)
    if image.shape[2] == 4:
        values[..., :3] *= values[..., 3:] / 255
    return values


def read_frame(path: Path) -> Image:
    """uint8 [h, w, 3 or 4]."""
    return np.asarray(imageio.imread(path))


def write_difference(folder: Path, name: str, golden: Image, actual: Image) -> None:
    """NAME-golden, -actual, -difference and -amplified.png in `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    levels = abs(_premultiplied(golden) - _premultiplied(actual)).max(axis=2)
    pictures = {"golden": golden, "actual": actual, "difference": levels, "amplified": levels * AMPLIFICATION}
    for kind, picture in pictures.items():
        imageio.imwrite(folder / f"{name}-{kind}.png", np.clip(picture, 0, 255).astype(np.uint8))
