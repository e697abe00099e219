"""Samples of folders of pictures."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, PngImagePlugin
from png_files import png_file, unfiltered
from statement_samples import Sample, Samples, Writer

from renderer.volume import Array

VALUES: Array = np.arange(48, dtype=np.uint8).reshape(2, 4, 6)
_COLORS = np.stack([VALUES, VALUES, VALUES], -1)


def write_pictures(folder: Path, values: Array = VALUES, *, orientation: int = 1, **options: Any) -> Path:
    """Write a PNG picture for each plane. orientation: in EXIF."""
    folder.mkdir(exist_ok=True)
    for k, plane in enumerate(values):
        picture = Image.fromarray(plane)
        exif = picture.getexif()
        exif[274] = orientation
        picture.save(folder / f"s{k}.png", exif=exif, **options)
    return folder


def write_deep_pictures(folder: Path, *, depth: int) -> Path:
    """Write a PNG picture of colours of 8 or 16 bits for each plane."""
    folder.mkdir(exist_ok=True)
    for k, plane in enumerate(_COLORS):
        stored = plane if depth == 8 else (plane.astype(np.uint16) * 257).astype(">u2")
        data = png_file(6, 4, unfiltered(stored), depth=depth)
        (folder / f"s{k}.png").write_bytes(data)
    return folder


def _pictures(values: Array = VALUES, **options: Any) -> Writer:
    return lambda folder: write_pictures(folder, values, **options)


def _with_palette(step: int) -> Writer:
    def write(folder: Path) -> Path:
        for k, plane in enumerate(VALUES):
            picture = Image.fromarray(plane, "P")
            picture.putpalette(bytes(value * step % 256 for value in range(256) for _ in range(3)))
            picture.save(folder / f"s{k}.png")
        return folder

    return write


def _with_gamma() -> PngImagePlugin.PngInfo:
    """Return the chunk of a linear picture."""
    info = PngImagePlugin.PngInfo()
    info.add(b"gAMA", struct.pack(">I", 100_000))
    return info


SAMPLES: Samples = {
    "PNG, JPEG and BMP": {
        "PLTE": Sample(_with_palette(1), _with_palette(3)),
        "Orientation": Sample(_pictures(), _pictures(orientation=6)),
        "pHYs": Sample(_pictures(), _pictures(dpi=(254, 254))),
        "16 bits": Sample(
            lambda folder: write_deep_pictures(folder, depth=8), lambda folder: write_deep_pictures(folder, depth=16)
        ),
        "gAMA": Sample(_pictures(), _pictures(pnginfo=_with_gamma())),
        "tRNS": Sample(_pictures(_COLORS), _pictures(_COLORS, transparency=(0, 0, 0))),
    }
}
