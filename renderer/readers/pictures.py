"""Read a folder of PNG, JPEG or BMP pictures as slices, in natural order (`2.png` before `10.png`).

Pillow decodes, in a child process (`isolation.py`). Pictures do not say how large a voxel is.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from renderer.readers.common import NO_SPACING, Image, choose, damaged_error, errors_about, require_exists, select_index
from renderer.readers.isolation import Host, allocate_voxels
from renderer.readers.slice_names import require_alike, sort_slices
from renderer.readers.sniff import read_start, slices_of_pictures
from renderer.readers.statements import FormatTable, Statement
from renderer.readers.units import NO_SIZES

STATEMENTS = FormatTable(
    "PNG, JPEG and BMP",
    (
        Statement("Orientation", "place", "which way up a picture is, in its EXIF"),
        Statement("palette", "values", "the colours that numbers stand for"),
        Statement("bit depth", "values", "16 bits of each colour, of which 8 are read", is_applied=False),
        Statement("resolution", "place", "pixels per inch, without a distance of slices", is_applied=False),
        Statement("transparency", "validity", "a number that stands for nothing", is_applied=False),
        Statement("gamma", "values", "the light that numbers stand for", is_applied=False),
    ),
)

_ORIENTATION = 274  # the number of the field of EXIF
# Of sRGB, which all pictures are taken for.
_GAMMA = 0.45455
# The bits of a colour and its kind in the header of a PNG; colours are the kinds 2 and 6.
_PNG_DEPTH, _PNG_COLORS = slice(24, 26), (b"\x10\x02", b"\x10\x06")
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
    values, expected, chosen, unapplied = None, "", None, None
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
                unapplied = STATEMENTS.note(_unapplied(picture, file))
            values[index] = np.atleast_3d(np.asarray(picture))[..., chosen.component]
    assert values is not None and chosen is not None, "called without files"
    return Image(values, np.eye(4), (NO_SPACING, *chosen.notes, unapplied), channels=chosen.channels)


def _unapplied(picture: Any, file: Path) -> set[str]:
    """Return what a picture states and is not applied, as STATEMENTS names it."""
    found = {"transparency"} if "transparency" in picture.info else set[str]()
    start = read_start(file, 26)[0]
    if start.startswith(b"\x89PNG") and start[_PNG_DEPTH] in _PNG_COLORS:
        found.add("bit depth")
    resolution = picture.info.get("dpi", (1, 1))
    if not all(any(math.isclose(n, k, rel_tol=2e-3) for k in NO_SIZES) for n in resolution):
        found.add("resolution")
    if not math.isclose(picture.info.get("gamma", _GAMMA), _GAMMA, rel_tol=1e-2):
        found.add("gamma")
    return found


@contextmanager
def _opened(file: Path) -> Iterator[Any]:
    """Provide a PIL.Image that is not decoded yet, with colours in place of a palette's numbers.

    Raises InputError for other and damaged files, also in the block, and for more pixels than they can hold.
    """
    from PIL import Image as pillow, ImageOps  # noqa: N813

    pillow.MAX_IMAGE_PIXELS = None  # sizes are checked below, and in `allocate_voxels`
    try:
        with pillow.open(file, formats=_FORMATS) as picture:
            if picture.width * picture.height > _MAX_PACKING * file.stat().st_size:
                got = f"{file.stat().st_size} bytes for {picture.width} x {picture.height} pixels"
                raise damaged_error("this picture has fewer bytes than its pixels need", got)
            turned = ImageOps.exif_transpose(picture) if picture.getexif().get(_ORIENTATION, 1) != 1 else picture
            yield turned.convert("RGB") if turned.mode == "P" else turned
    except (OSError, SyntaxError, ValueError, IndexError) as error:
        raise damaged_error("this picture cannot be decoded", expected="PNG, JPEG or BMP") from error
