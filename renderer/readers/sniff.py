"""Reject files and folders that cannot be a volume, from their first bytes and without loading a library.

The readers reject all of these, too, and know far more.
"""

from __future__ import annotations

import os
from pathlib import Path

from renderer.errors import InputError

KNOWN_FORMATS = "NRRD (.nrrd, .nhdr), MetaImage (.mha, .mhd), NIfTI (.nii, .nii.gz), TIFF (.tif), NumPy (.npy) or DICOM"


class UnknownFormatError(InputError):
    """A file in no known format with a header: it may have no header, or be damaged."""

    def __init__(self, path: Path, *, is_empty: bool) -> None:
        super().__init__(
            "this is not a volume in a known format, or it is damaged",
            where=str(path),
            got="an empty file" if is_empty else None,
            expected=KNOWN_FORMATS,
            hint="voxels without a header are read with `raw: {file, shape, dtype, spacing}`",
        )


# The first bytes of files with these suffixes.
_SIGNATURES = {
    ".nrrd": (b"NRRD",),
    ".nhdr": (b"NRRD",),
    ".npy": (b"\x93NUMPY",),
    ".tif": (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"),
    ".tiff": (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"),
}
# Formats with text headers: MetaImage, and VTK's, which SimpleITK reads.
_TEXT_FORMATS = (".mha", ".mhd", ".vtk")
_FIRST_BYTES = 1024


def require_volume_file(path: Path) -> None:
    """Raise InputError if `path`, an existing file with a header or a folder, cannot be a volume."""
    if not os.access(path, os.R_OK):
        raise InputError("no permission to read this", where=str(path))
    if path.is_dir():
        entries = list(path.iterdir())
        if not any(_may_be_slice(entry) for entry in entries):
            raise InputError(
                "this folder holds neither a DICOM series nor TIFF slices",
                where=str(path),
                got=None if entries else "an empty folder",
                expected="the files of one DICOM series, or .tif files, directly in the folder",
            )
        return
    try:
        with path.open("rb") as file:
            start = file.read(_FIRST_BYTES)
    except OSError as error:
        raise InputError("cannot read this file", where=str(path), got=error.strerror) from error
    if not _may_be_volume(path.suffix.lower(), start):
        raise UnknownFormatError(path, is_empty=not start)


def _may_be_slice(path: Path) -> bool:
    """Return whether a folder's entry can be a TIFF file or a DICOM file, which may have any name.

    The numbers in their first bytes contain zeros. Entries that cannot be opened are left to the readers.
    """
    if path.suffix.lower() in (".tif", ".tiff"):
        return True
    try:
        if not path.is_file():
            return False
        with path.open("rb") as file:
            return b"\0" in file.read(_FIRST_BYTES)
    except OSError:
        return True


def _may_be_volume(suffix: str, start: bytes) -> bool:
    if suffix in _SIGNATURES:
        return start.startswith(_SIGNATURES[suffix])
    if suffix in _TEXT_FORMATS:
        return bool(start)
    # All other formats have headers with small binary numbers, and so with zeros.
    return b"\0" in start or start.startswith(b"NRRD") or suffix in (".gz", ".bz2")
