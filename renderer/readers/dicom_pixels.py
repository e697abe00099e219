"""Decode the stored pixels of a DICOM file, and look up their colours in a palette."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from renderer.readers.dicom_fields import Dataset, numbers_of, open_dicom, text_of, unreadable_slice
from renderer.readers.dicom_kinds import compression_error
from renderer.volume import Array

# Fields that pydicom needs to decode pixels, with the values that are assumed where a writer left them out.
_USUAL = {"SamplesPerPixel": 1, "PhotometricInterpretation": "MONOCHROME2", "PixelRepresentation": 0}
# The beginnings of the keywords of fields with a palette: a list of colours.
_PALETTES = [f"{color}PaletteColorLookupTable" for color in ("Red", "Green", "Blue")]


def has_palette(dataset: Dataset) -> bool:
    """Return whether the stored values are indices into a palette of the file.

    The stored values of a segmentation are labels, also if it has a palette.
    """
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


def stored_frames(path: Path, numbers: Sequence[int]) -> Iterator[tuple[int, Array]]:
    """Yield chosen frames of a file, each with its number: stored pixels [y, x, sample], or colours of a palette.

    Frames are decoded one at a time, unless a pixel is a bit and frames do not begin at a whole byte. Raises InputError
    for pixels that cannot be decoded.
    """
    from pydicom.pixels.utils import iter_pixels

    dataset = _with_pixels(path)
    samples = int(dataset.get("SamplesPerPixel") or 1)
    shape, is_palette = (int(dataset.Rows), int(dataset.Columns), samples), has_palette(dataset)
    in_bits = dataset.get("BitsAllocated") == 1 and math.prod(shape) % 8 != 0
    frames = None if in_bits else iter_pixels(dataset, indices=list(numbers))
    for number in numbers:
        try:
            pixels = next(frames) if frames else dataset.pixel_array.reshape(-1, *shape)[number]
            stored = _without_unused_bits(np.asarray(pixels).reshape(shape), dataset)
            colors = _colors_of(stored, dataset) if is_palette else stored
        except Exception as error:  # decoders raise any exception for damaged bytes
            raise unreadable_slice(path) from error
        yield number, colors


def _with_pixels(path: Path) -> Dataset:
    """Return all fields of a file; missing fields that pydicom needs to decode pixels are filled in.

    Raises InputError for compressions that cannot be decoded.
    """
    from pydicom.uid import ExplicitVRBigEndian, ExplicitVRLittleEndian, ImplicitVRLittleEndian

    dataset, _ = open_dicom(path, with_pixels=True)
    if "Rows" not in dataset:  # pydicom drops all fields of a file whose compressed pixels break off
        raise unreadable_slice(path)
    if dataset.file_meta.get("TransferSyntaxUID") is None:  # a file without a preamble
        is_implicit, is_little = dataset.original_encoding
        explicit = ExplicitVRLittleEndian if is_little else ExplicitVRBigEndian
        dataset.file_meta.TransferSyntaxUID = ImplicitVRLittleEndian if is_implicit else explicit
    for keyword, usual in _USUAL.items():
        dataset.setdefault(keyword, usual)
    if (refusal := compression_error(path, dataset)) is not None:
        raise refusal
    return dataset


def _colors_of(stored: Array, dataset: Dataset) -> Array:
    """Return the colours [y, x, 3] of stored indices into a palette."""
    from pydicom.pixels.processing import apply_color_lut

    return np.asarray(apply_color_lut(stored[..., 0], dataset))[..., :3].astype(palette_dtype(dataset))


def _without_unused_bits(pixels: Array, dataset: Dataset) -> Array:
    """Return pixels without the bits that BitsStored does not count, which may hold overlays; signs are kept."""
    stored = int(dataset.get("BitsStored") or 16)
    unused = 8 * pixels.itemsize - stored
    if pixels.dtype.kind == "f" or unused <= 0:
        return pixels
    shift = int(dataset.get("HighBit") or stored - 1) + 1 - stored
    return np.right_shift(np.left_shift(pixels, unused - shift), unused)
