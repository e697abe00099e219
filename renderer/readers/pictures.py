"""Read a folder of PNG, JPEG or BMP pictures as slices, in natural order (`2.png` before `10.png`).

Pillow decodes, in a child process (`isolation.py`). Pictures do not say how large a voxel is.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from renderer.readers.common import NO_SPACING, Image, choose, damaged_error, errors_about, require_exists, select_index
from renderer.readers.isolation import Host, allocate_voxels
from renderer.readers.slice_names import require_alike, sort_slices
from renderer.readers.sniff import slices_of_pictures

_FORMATS = ("PNG", "JPEG", "BMP")
# No method of these formats packs pixels more: about 1228 of JPEG in a byte, 1032 of deflate.
_MAX_PACKING = 2**11


def read_pictures(
    path: Path, time: int | None, component: int | None, *, has_spacing_override: bool, host: Host
) -> Image:
    """Read one component of the pictures in a folder, whose colours are components.

    has_spacing_override: not used; pictures have no lengths. Raises InputError for pictures that are damaged or differ,
        and if `time` or `component` do not fit.
    """
    select_index("time", time, 1)
    files = sort_slices(slices_of_pictures(path))
    values, expected, chosen = None, "", None
    for index, file in enumerate(files):
        host.begin_file(file)
        with errors_about(file), _opened(require_exists(file)) as picture:
            bands = picture.getbands()
            found = f"{picture.width} x {picture.height} {picture.mode}"
            expected = expected or found
            require_alike(found, expected, files[0])
            if chosen is None or values is None:
                chosen = choose("c", (len(bands),), None, component, bands if len(bands) > 1 else ())
                dtype = np.uint16 if picture.mode.startswith("I") else np.uint8
                values = allocate_voxels(host, (len(files), picture.height, picture.width), dtype)
            values[index] = np.atleast_3d(np.asarray(picture))[..., chosen.component]
    assert values is not None and chosen is not None, "called without files"
    return Image(values, np.eye(4), (NO_SPACING, *chosen.notes), channels=chosen.channels)


@contextmanager
def _opened(file: Path) -> Iterator[Any]:
    """Provide a PIL.Image that is not decoded yet, with colours in place of a palette's numbers.

    Raises InputError for other and damaged files, also in the block, and for more pixels than they can hold.
    """
    from PIL import Image as pillow  # noqa: N813

    pillow.MAX_IMAGE_PIXELS = None  # sizes are checked below, and in `allocate_voxels`
    try:
        with pillow.open(file, formats=_FORMATS) as picture:
            if picture.width * picture.height > _MAX_PACKING * file.stat().st_size:
                got = f"{file.stat().st_size} bytes for {picture.width} x {picture.height} pixels"
                raise damaged_error("this picture has fewer bytes than its pixels need", got)
            yield picture.convert("RGB") if picture.mode == "P" else picture
    except (OSError, SyntaxError, ValueError, IndexError) as error:
        raise damaged_error("this picture cannot be decoded", expected="PNG, JPEG or BMP") from error
