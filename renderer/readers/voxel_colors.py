"""Join the components of coloured voxels into colours of 8 bits, and luminance or alpha as their values."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from renderer.errors import InputError
from renderer.readers.image import Image
from renderer.readers.voxel_limits import check_memory
from renderer.scene import counted, join_some
from renderer.volume import Array, UInt8, backing_file, guard_mapping

# The weights of red, green and blue in luminance (Rec. 709).
_WEIGHTS = np.array([0.2126, 0.7152, 0.0722], np.float32)
# The numbers that may stand for white in the components of a colour. If these are floats, 1 may stand for white, too.
_WHITE = (255, 65535)


def join_colors(first: Image, component: str, read: Callable[[int], Image]) -> tuple[Image, UInt8]:
    """Return an image of luminance in 8 bits, or of alpha for `color_alpha`, and the colours, uint8 [z, y, x, 3].

    first: the first component. read: a function that reads another component. Voxels with a component that is NaN or
    infinite are NaN. Raises InputError for components that are not colours, and for lack of memory.
    """
    count = max(1, len(first.channels))
    names = f" ({join_some([each.name for each in first.channels])})" if count > 1 and first.channels[0].name else ""
    got = f"component: {component}, of a file with {counted(count, 'component')}{names}"
    if count not in (3, 4):
        raise InputError("these voxels are not colours", got=got, expected="3 components, or 4 with alpha")
    if component == "color_alpha" and count == 3:
        hint = "`component: color` takes opacities from luminance"
        raise InputError("these colours have no alpha", got=got, expected="4 components", hint=hint)
    shape = first.values.shape
    check_memory(4 * first.values.size)
    parts = [first.values, *(read(k).values for k in range(1, count))]
    files = [file for part in parts if (file := backing_file(part))]
    for file, part in zip(files, parts, strict=False):  # either all parts are mapped, or none
        guard_mapping(file, part)
    white = _white_of(parts)
    may_be_absent, is_byte = first.values.dtype.kind == "f", first.values.dtype == np.uint8
    colors, scalars = np.empty((*shape, 3), np.uint8), np.empty(shape, np.float32 if may_be_absent else np.uint8)
    for z, planes in enumerate(zip(*parts, strict=True)):
        in_bytes = [_in_bytes(plane, white) for plane in planes]
        colors[z] = np.stack(in_bytes[:3], axis=-1)
        scalars[z] = in_bytes[3] if component == "color_alpha" else np.rint(colors[z] @ _WEIGHTS)
        if may_be_absent:
            scalars[z][~np.isfinite(planes).all(axis=0)] = np.nan
    for file in files:
        file.require_unchanged()
    if not np.isnan(scalars).any():
        scalars = scalars.astype(np.uint8, copy=False)
    note = None if is_byte else f"colours of {first.values.dtype.name} become 8 bits: {white} is 255"
    units = first.units._replace(value_unit="")
    joined = replace(first, values=scalars, notes=(*first.notes, note), nodata=(), units=units, is_on_disk=False)
    return joined, colors


def _white_of(parts: list[Array]) -> int:
    """Return the number that stands for white: the smallest of the possible numbers that no component exceeds."""
    if parts[0].dtype == np.uint8:
        return _WHITE[0]
    finite = (plane[np.isfinite(plane)] for part in parts for plane in part)
    ends = [(plane.min().item(), plane.max().item()) for plane in finite if plane.size] or [(0, 0)]
    low, high = min(low for low, _ in ends), max(high for _, high in ends)
    of_type = (1, *_WHITE) if parts[0].dtype.kind == "f" else _WHITE
    if low < 0 or high > of_type[-1]:
        expected = "whole numbers from 0 to 255 or 65535, or floats that may also be from 0 to 1"
        raise InputError("these components are not colours", got=f"values from {low:g} to {high:g}", expected=expected)
    return next(white for white in of_type if high <= white)


def _in_bytes(plane: Array, white: int) -> Any:
    if plane.dtype == np.uint8:
        return plane
    return np.rint(np.nan_to_num(plane.astype(np.float64), nan=0, posinf=0, neginf=0) * (255 / white)).astype(np.uint8)
