"""Encode float pictures as OpenEXR files, and decode them, with the package OpenEXR."""

from __future__ import annotations

import io
from importlib import import_module
from types import ModuleType

import numpy as np
import numpy.typing as npt

from renderer.errors import require_package

# The first bytes of an EXR file.
EXR_BEGIN = b"v/1\x01"
# The comment in the header of EXR files about the meaning of their numbers: other programs expect scene-linear colours,
# which are in proportion to light.
_COMMENTS = (
    "hsplat: display-referred colours as composited, 1 is white, neither rounded nor clipped; not scene-linear. "
    "Alpha, where there is one, is 1 minus transmittance, and colours are multiplied by it."
)


def encode_exr(image: npt.NDArray[np.float32], dpi: float | None = None) -> bytes:
    """Return an EXR file of `image`, float32 [h, w, 3] or, premultiplied, [h, w, 4].

    dpi: the resolution that the file states, in pixels per inch.
    """
    openexr, stream = require_openexr(), io.BytesIO()
    header = {"compression": openexr.ZIP_COMPRESSION, "type": openexr.scanlineimage, "comments": _COMMENTS}
    header |= {"xDensity": float(dpi)} if dpi else {}
    openexr.File(header, {"RGB" if image.shape[2] == 3 else "RGBA": np.ascontiguousarray(image)}).write(stream)
    return stream.getvalue()


def decode_exr(content: bytes) -> npt.NDArray[np.float32]:
    """Return the picture in a file from `encode_exr`. Raises ValueError with the reason."""
    try:
        file = require_openexr().File(io.BytesIO(content))
        image = next(iter(file.channels().values())).pixels
    except (RuntimeError, ValueError, StopIteration) as error:
        raise ValueError("damaged") from error
    if image.dtype != np.float32 or image.ndim != 3 or image.shape[2] not in (3, 4):
        raise ValueError("not of floats in RGB or RGBA")
    return np.asarray(image)


def require_openexr() -> ModuleType:
    """Return the module OpenEXR. Raises InputError if it is not installed."""
    require_package("OpenEXR", extra="exr")
    return import_module("OpenEXR")
