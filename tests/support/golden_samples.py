"""Goldens and reports that tests make without drawing: pictures of noise, and records of them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from hsplat_cli.compare import (
    Golden,
    GoldenPicture,
    GoldenRecord,
    GoldenVolume,
    Origin,
    golden_file_name,
    picture_digest,
)
from renderer.film import Pixels, encode_png

ORIGIN = Origin(GoldenVolume("scan.npy", "0" * 32, (8, 8, 8), "uint8"), "a device", {"mode": 1}, {"hsplat": "1"})


def picture(seed: int) -> Pixels:
    """Return a picture of noise."""
    return np.random.default_rng(seed).integers(0, 256, (8, 8, 3), np.uint8)


def record_of(pictures: Mapping[int, Pixels]) -> GoldenRecord:
    """Return the content of golden.json for the pictures of frames."""
    frames = [
        Golden(frame, (GoldenPicture(picture_digest(pixels), 0, golden_file_name(frame, 10)),))
        for frame, pixels in pictures.items()
    ]
    return GoldenRecord((ORIGIN,), tuple(frames), ":")


def contents_of(pictures: Mapping[int, Pixels]) -> dict[str, partial[bytes]]:
    """Return functions that return the contents of the files of goldens."""
    return {golden_file_name(frame, 10): partial(encode_png, pixels) for frame, pixels in pictures.items()}
