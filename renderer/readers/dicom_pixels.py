"""Decode the pixels of a DICOM file: those that are stored, and the colours that a palette makes of them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from renderer.readers.dicom_fields import Dataset, numbers_of, open_dicom, text_of, unreadable_slice
from renderer.readers.dicom_kinds import compression_error
from renderer.volume import Array

# Fields without which pydicom decodes no pixels, and what they are where a writer left them out.
_USUAL = {"SamplesPerPixel": 1, "PhotometricInterpretation": "MONOCHROME2", "PixelRepresentation": 0}
_PALETTES = [f"{color}PaletteColorLookupTable" for color in ("Red", "Green", "Blue")]


def has_palette(dataset: Dataset) -> bool:
    """Return whether the stored values are numbers of colours, and the file has these colours; labels have others."""
    is_palette = text_of([dataset], "PhotometricInterpretation").strip() == "PALETTE COLOR"
    has_colors = all(
        len(numbers_of([dataset], f"{name}Descriptor")) == 3
        and (f"{name}Data" in dataset or f"Segmented{name}Data" in dataset)
        for name in _PALETTES
    )
    return is_palette and has_colors and "SegmentSequence" not in dataset


def palette_dtype(dataset: Dataset) -> np.dtype[Any]:
    """Return the dtype of the colours of a palette."""
    return np.dtype(np.uint16 if numbers_of([dataset], f"{_PALETTES[0]}Descriptor")[2] > 8 else np.uint8)


def pixels_of(path: Path) -> Array:
    """Return the stored pixels of a file, [frame, y, x, sample], and of a palette its colours; raises InputError if
    they cannot be decoded."""
    from pydicom.pixels.processing import apply_color_lut
    from pydicom.uid import ExplicitVRBigEndian, ExplicitVRLittleEndian, ImplicitVRLittleEndian

    dataset, _ = open_dicom(path, with_pixels=True)
    syntax = dataset.file_meta.get("TransferSyntaxUID")
    if syntax is None:  # without a preamble
        is_implicit, is_little = dataset.original_encoding
        explicit = ExplicitVRLittleEndian if is_little else ExplicitVRBigEndian
        dataset.file_meta.TransferSyntaxUID = ImplicitVRLittleEndian if is_implicit else explicit
    for keyword, usual in _USUAL.items():
        dataset.setdefault(keyword, usual)
    if (refusal := compression_error(path, dataset)) is not None:
        raise refusal
    try:
        pixels = np.asarray(dataset.pixel_array)
    except Exception as error:  # of its decoders
        raise unreadable_slice(path) from error
    samples = int(dataset.get("SamplesPerPixel") or 1)
    frames = int(dataset.get("NumberOfFrames") or 1)
    pixels = pixels.reshape(-1, int(dataset.Rows), int(dataset.Columns), samples)
    stored = _without_unused_bits(pixels[:frames], dataset)  # what is left over may be padding
    if not has_palette(dataset):
        return stored
    try:
        return np.asarray(apply_color_lut(stored[..., 0], dataset))[..., :3].astype(palette_dtype(dataset))
    except Exception as error:  # of its parser, for damaged palettes
        raise unreadable_slice(path, "its palette is truncated or damaged") from error


def _without_unused_bits(pixels: Array, dataset: Dataset) -> Array:
    """Return the values of the stored bits alone: others may hold overlays, and the sign may not reach into them."""
    stored = int(dataset.get("BitsStored") or 16)
    unused = 8 * pixels.itemsize - stored
    if pixels.dtype.kind == "f" or unused <= 0:
        return pixels
    shift = int(dataset.get("HighBit") or stored - 1) + 1 - stored
    return np.right_shift(np.left_shift(pixels, unused - shift), unused)
