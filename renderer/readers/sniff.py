"""Find the format of a volume file by its first bytes and its name, and the volume in a folder; load no library."""

from __future__ import annotations

import gzip
import math
import os
import re
import struct
import zlib
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import IO, Literal, cast

from renderer.errors import InputError
from renderer.readers.dicom_tags import summarize
from renderer.readers.foreign import compressed_error, refuse_bytes, refuse_name
from renderer.readers.headerless import Declaration, declaration_in_name
from renderer.scene import VOLUME_SUFFIXES, has_steps_in_time, is_pattern, is_url, join_some, short_text
from renderer.stores import is_store, is_zipped_store

Format = Literal[
    "nrrd", "metaimage", "nifti", "mgh", "tiff", "npy", "npz", "vtk", "cube", "dicom", "mrc", "hdf5", "pictures",
    "masks", "store",
]  # fmt: skip

KNOWN_FORMATS = (
    "NRRD (.nrrd, .nhdr), MetaImage (.mha, .mhd), NIfTI (.nii, .nii.gz), Analyze (.hdr), "
    "FreeSurfer (.mgh, .mgz), TIFF (.tif), NumPy (.npy, .npz), VTK (.vti, .pvti, .vtr, .vtk), Gaussian cube (.cube), "
    "MRC (.mrc, .map, .ccp4), HDF5 (.h5), netCDF-4 (.nc), OME-Zarr, Zarr, N5, Neuroglancer or DICOM"
)

# The first bytes of HDF5, which may follow a block of other data.
_HDF5 = b"\x89HDF\r\n\x1a\n"
# The first bytes of a ZIP archive.
_ZIP = b"PK\3\4"
# The format of a file, by the bytes with which the file begins.
_SIGNATURES: dict[bytes, Format] = {
    b"NRRD": "nrrd",
    b"\x93NUMPY": "npy",
    _ZIP: "npz",
    b"# vtk DataFile": "vtk",
    **dict.fromkeys((b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"), "tiff"),
}
# The format of a file, by the end of its name, for formats that the first bytes of a file do not always show.
_SUFFIXES: dict[str, Format] = {
    **dict.fromkeys((".mha", ".mhd"), "metaimage"),
    **dict.fromkeys((".nii", ".hdr", ".img", ".nii.gz", ".hdr.gz", ".img.gz"), "nifti"),
    **dict.fromkeys((".mgh", ".mgz", ".mgh.gz"), "mgh"),
    **dict.fromkeys((".cube", ".cub"), "cube"),
    **dict.fromkeys((".tif", ".tiff", ".ome"), "tiff"),
}
# Ends of file names that volumes share with other files: the first bytes must show that a file is a volume.
_SHARED_SUFFIXES = (".hdr", ".hdr.gz", ".map", ".rec", ".h5", ".hdf5", ".ims", ".mat")
# Ends of the names of MRC files.
_MRC_SUFFIXES = (".mrc", ".mrcs", ".map", ".ccp4", ".rec")
# The offset of the mark in the header of an MRC file, in bytes. Older files have no mark.
_MRC_MARK_AT = 208
# The mark in the header of an MRC file.
MRC_MARK = b"MAP"
# The mark in the header of an MRC file, with the byte order behind it.
_MRC_STAMP = re.compile(rb"MAP[ \0][\x44\x11\0]")
TIFF_SUFFIXES = (".tif", ".tiff")
_PICTURE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp")
# The first field of DICOM without a preamble, in group 2 or 8: with the letters of its type; or with a length alone,
# and then the next field must be in group 8.
_FIRST_FIELD = re.compile(rb"[\x02\x08]\0.\0(?:[A-Z]{2}|(?P<length>.)\0\0\0)", re.DOTALL)
# The number of first bytes that are read to recognise a format.
_FIRST_BYTES = 4096
# The first bytes of gzip.
_GZIP = b"\x1f\x8b"
# The first bytes of NIfTI headers: the length of the header, in either byte order.
NIFTI_STARTS = [struct.pack(order + "i", length) for length in (348, 540) for order in "<>"]
# Bytes of the header of DICOMDIR, an index of other files: the UID of the class "media storage directory".
_DICOM_INDEX = b"1.2.840.10008.1.3.10\2"
# The places in a NIfTI-1 header of the fields that masks of one grid share: the numbers of voxels and their type, the
# sizes of voxels, and the two affines.
_GRID = (slice(40, 56), slice(70, 74), slice(76, 108), slice(252, 328))
# The types of voxels of masks, as codes of NIfTI, with their bytes: unsigned and signed integers of 8 and 16 bits.
_MASK_TYPES = {2: 1, 256: 1, 4: 2, 512: 2}
# The number of bytes of a NIfTI-1 header.
_NIFTI_BYTES = 348
# The number of bytes of a mask that are looked at at once.
_PIECE_BYTES = 2**20
# The largest number of bytes of a mask that are looked at. A small file may be a huge volume of zeros.
_MAX_MASK_BYTES = 2**28
# The largest number of files and folders that a search for volumes looks at.
_MAX_ENTRIES = 10_000


class UnknownFormatError(InputError):
    """An error about a file in no known format with a header: it may have no header, or be damaged.

    declaration: the declaration of voxels without a header that the file's name suggests, if any.
    """

    declaration: Declaration | None = None


def find_format(path: Path) -> Format:
    """Return the format of a volume file; raises UnknownFormatError for any other file."""
    content, is_compressed = read_start(path, _FIRST_BYTES)
    if not content and not is_compressed:
        raise InputError("an empty file", where=str(path))
    refuse_bytes(path, content)
    name = path.name.lower()
    if content.startswith(_ZIP) and is_zipped_store(path):
        return "store"
    found = _format_by_bytes(path) or next((form for end, form in _SUFFIXES.items() if name.endswith(end)), None)
    if found is not None:
        return found
    if is_compressed:
        inside = _format_by_signature(content)
        raise compressed_error(path, f"a file of {inside.upper()}" if inside else "a file of unknown content")
    refuse_name(path)
    error = UnknownFormatError(
        "this is not a volume in a known format, or it is damaged",
        where=str(path),
        expected=KNOWN_FORMATS,
        hint="voxels without a header are read with `raw: {file, shape, dtype, spacing}`",
    )
    error.declaration = declared = declaration_in_name(path)
    if declared is not None:
        order = ", byte_order: big" * declared.is_big_endian
        raw = f"raw: {{file: {short_text(path.name)}, shape: {list(declared.shape)}, dtype: {declared.dtype}{order}}}"
        error.expected = None
        error.hint = f"`{raw}` reads it as voxels without a header: {declared.remark}"
    raise error


def _format_by_bytes(path: Path) -> Format | None:
    """Return the format that the first bytes of a file show, also behind gzip for MRC and NIfTI; None if unknown."""
    content, is_compressed = read_start(path, _FIRST_BYTES)
    found = None if is_compressed else _format_by_signature(content)
    if found is not None:
        return found
    if _MRC_STAMP.match(content, _MRC_MARK_AT) or (path.suffix.lower() in _MRC_SUFFIXES and _has_sizes_of_mrc(content)):
        return "mrc"
    return "nifti" if content[:4] in NIFTI_STARTS and not _begins_like_dicom(content) else None


def _format_by_signature(start: bytes) -> Format | None:
    if _begins_like_dicom(start):
        return "dicom"
    for signature, found in _SIGNATURES.items():
        if start.startswith(signature):
            return found
    if any(start.startswith(_HDF5, at) for at in (0, 512, 1024, 2048)):  # perhaps behind a user block
        return "hdf5"
    return "vtk" if b"<VTKFile" in start else None


def _has_sizes_of_mrc(content: bytes) -> bool:
    """Return whether a file begins with three sizes and a mode of MRC, in either byte order."""
    fields = [struct.unpack_from(order + "4i", content) for order in "<>" if len(content) >= 16]
    return any(min(sizes) >= 1 and max(sizes) < 2**16 and 0 <= mode < 128 for *sizes, mode in fields)


def is_dicom(path: Path) -> bool:
    """Return whether a file begins like DICOM, with or without a preamble, and is not an index of other files."""
    start = _start(path) if path.is_file() else b""
    return _begins_like_dicom(start) and _DICOM_INDEX not in start


def series_of_slice(path: Path) -> str | None:
    """Return the series of a DICOM file of one frame, which may be an empty text; None for any other file."""
    summary = summarize(path) if is_dicom(path) else None
    return summary.series if summary is not None and summary.num_frames == 1 else None


def natural_sort_key(name: str) -> tuple[list[str | int], str]:
    """Return a sort key that puts `2.tif` before `10.tif`; the name breaks ties such as `1.tif` and `01.tif`."""
    parts: list[str | int] = list(re.split("([0-9]+)", name.lower()))
    parts[1::2] = map(int, parts[1::2])
    return parts, name


def find_volume(path: Path) -> tuple[Path, Format, str | None]:
    """Return the path of the volume in a folder, its format, and a note if the path is not the folder itself.

    Slices or masks directly in the folder are its volume; otherwise it is the only volume file, or folder of slices,
    anywhere below. A path of a file is returned as it is. Raises InputError for no volume and for several.
    """
    if not os.access(path, os.R_OK):
        raise InputError("no permission to read this", where=str(path))
    if not path.is_dir():
        return path, find_format(path), None
    if is_store(path):
        return path, "store", None
    own = _format_of_slices(path)
    if own not in (None, "pictures"):
        others = sorted(short_text(each.name) for each in path.iterdir() if own != "masks" and _is_volume(each))
        note = f"its {own.upper()} slices are one volume, which is read; left out: {join_some(others)}"
        return path, own, note if others else None
    found = _search(path)
    if len(found) != 1:
        names = [short_text(str(each.relative_to(path))) for each in found]
        raise InputError(
            f"this folder holds {len(found)} volumes, and one is rendered" if found else "this folder holds no volume",
            where=str(path),
            got=join_some(names) if found else "an empty folder" if not any(path.iterdir()) else None,
            expected=None if found else f"slices of DICOM, TIFF, PNG, JPEG or BMP, or a file of {KNOWN_FORMATS}",
            hint=f"name one of them: {found[0]}; `hsplat turntable {path}` draws each of them" if found else None,
        )
    volume = found[0]
    about = None if volume == path else f"the only volume in this folder, {volume.relative_to(path)}, is read"
    return volume, (volume.is_dir() and _format_of_slices(volume)) or find_format(volume), about


def is_volume_name(name: str | os.PathLike[str]) -> bool:
    """Return whether a name belongs to a folder or to a file in a known format, or is a pattern of such files.

    The URL of a store is such a name, too.
    """
    if is_url(name) or is_pattern(name):
        return True
    with suppress(InputError):
        return os.path.isdir(name) or (os.path.isfile(name) and bool(find_format(Path(name))))
    return False


def volumes_in(folder: Path) -> list[Path]:
    """Return the volumes below a folder, among them folders of slices.

    Returns an empty list if the folder itself is a volume of slices or masks, or has only one volume. Raises InputError
    for slices of several formats, and for too many files.
    """
    if is_store(folder):
        return []
    found = _search(folder) if _format_of_slices(folder) in (None, "pictures") else []
    return found if len(found) > 1 else []


def _format_of_slices(folder: Path) -> Format | None:
    """Return the format of the slices or masks directly in a folder; None if there are none.

    DICOMDIR, an index of other files, is not a slice, nor are DICOM files that are a volume each. Pictures beside
    slices of TIFF or DICOM are left out. Raises InputError for slices of TIFF and DICOM together.
    """
    entries = _files_in(folder)
    tiffs = [entry for entry in entries if entry.suffix.lower() in TIFF_SUFFIXES]
    dicoms = (entry for entry in sorted(entries) if entry.suffix.lower() not in TIFF_SUFFIXES and is_dicom(entry))
    first = next(dicoms, None)
    if tiffs and first is not None:
        raise InputError(
            "this folder holds both TIFF slices and DICOM files",
            where=str(folder),
            got=f"{min(tiffs).name} and {first.name}",
            expected="the slices of one volume",
            hint="put each volume into its own folder",
        )
    if tiffs:
        return "tiff"
    if first is not None:
        return None if _volumes_of_frames(folder) else "dicom"
    if masks_in(folder):
        return "masks"
    return "pictures" if len(slices_of_pictures(folder)) > 1 else None


def masks_in(folder: Path) -> list[Path]:
    """Return the masks directly in a folder, in natural order: NIfTI files with only 0 and 1, on one grid.

    Returns an empty list if the folder has fewer than two volumes, any other volume, or steps in time. The voxels of
    the first file alone are looked at, and a file that ends within its header counts as a mask: the reader reports it.
    """
    files = [file for file in _files_in(folder) if _is_volume(file)]
    files.sort(key=lambda file: natural_sort_key(file.name))
    if len(files) < 2 or not all(file.name.lower().endswith((".nii", ".nii.gz")) for file in files):
        return []
    if has_steps_in_time(folder):
        return []
    headers = {file: read_start(file, _NIFTI_BYTES)[0] for file in files}
    whole = [file for file in files if len(headers[file]) == _NIFTI_BYTES]
    if not whole or not _is_of_masks(headers[whole[0]]):
        return []
    if len({tuple(headers[file][part] for part in _GRID) for file in whole}) > 1:
        return []
    state = whole[0].stat()
    mark = (state.st_ino, state.st_size, state.st_mtime_ns)
    return files if _has_only_flags(whole[0], headers[whole[0]], mark) else []


def _is_of_masks(header: bytes) -> bool:
    """Return whether the header of a NIfTI-1 file states a volume of small integers, without a scale."""
    order = _order_of(header)
    if struct.unpack_from(f"{order}i", header)[0] != _NIFTI_BYTES:
        return False
    num_axes, kind = (struct.unpack_from(f"{order}h", header, at)[0] for at in (40, 70))
    slope, intercept = struct.unpack_from(f"{order}2f", header, 112)
    return bool(num_axes == 3 and kind in _MASK_TYPES and slope in (0, 1) and intercept == 0)


@lru_cache(maxsize=64)
def _has_only_flags(file: Path, header: bytes, _mark: tuple[int, int, int]) -> bool:
    """Return whether the voxels of a NIfTI-1 file are only 0 and 1, as far as they can be read.

    Damage does not matter here: the reader reports it. A command asks several times, and mostly while nothing changes.
    _mark: the inode number, the size and the modification time of the file, until a change of which the answer is kept.
    """
    order = _order_of(header)
    *sizes, kind = struct.unpack_from(f"{order}3h", header, 42) + struct.unpack_from(f"{order}h", header, 70)
    offset, width = struct.unpack_from(f"{order}f", header, 108)[0], _MASK_TYPES[kind]
    if min(sizes) < 1 or not _NIFTI_BYTES <= offset <= _PIECE_BYTES:
        return False
    num_left = min(math.prod(sizes) * width, _MAX_MASK_BYTES)
    with suppress(OSError, EOFError, zlib.error), _opened(file) as opened:
        opened.seek(int(offset))
        while num_left > 0 and (piece := opened.read(min(num_left, _PIECE_BYTES))):
            low = piece[order == ">" :: 2] if width == 2 else piece
            high = piece[order == "<" :: 2] if width == 2 else b""
            if low.translate(None, b"\0\1") or high.strip(b"\0"):
                return False
            num_left -= len(piece)
    return True


def _order_of(header: bytes) -> str:
    """Return the byte order of a NIfTI-1 header, as `struct` names it."""
    return "<" if struct.unpack_from("<i", header)[0] == _NIFTI_BYTES else ">"


def _opened(file: Path) -> IO[bytes]:
    """Return a file open for reading, decompressed if it is gzip."""
    return cast(IO[bytes], gzip.open(file)) if _start(file)[:2] == _GZIP else file.open("rb")


def _volumes_of_frames(folder: Path) -> list[Path]:
    """Return the DICOM files directly in a folder that are a volume each: each has several frames.

    Returns an empty list if most files have one frame, and so are slices, or if all files belong to one series.
    """
    files = _files_in(folder)
    num_single, series = 0, dict[Path, str]()
    for file in files:
        summary = summarize(file) if is_dicom(file) else None
        if summary is not None and summary.num_frames > 1:
            series[file] = summary.series
        num_single += summary is not None and summary.num_frames == 1
        if 2 * num_single > len(files):
            return []
    return list(series) if len(set(series.values())) > 1 and len(series) > num_single else []


def slices_of_pictures(folder: Path) -> list[Path]:
    """Return the pictures directly in a folder."""
    return [entry for entry in _files_in(folder) if entry.suffix.lower() in _PICTURE_SUFFIXES]


def _files_in(folder: Path) -> list[Path]:
    names = (entry for entry in folder.iterdir() if not entry.name.startswith(".") and entry.name.upper() != "DICOMDIR")
    return [entry for entry in names if entry.is_file()]


def _search(folder: Path) -> list[Path]:
    """Return the volume files and the folders of slices or masks below a folder, each once.

    Links to folders are not followed. The files of a folder come in natural order, and before the files of its
    subfolders. Without volume files and slices of other formats, returns the folders of pictures, perhaps the folder
    itself; beside a volume, pictures are likely to be views of it. Raises InputError for more than _MAX_ENTRIES files
    and folders, as volumes could be missed.
    """
    num_left, found, pictures = _MAX_ENTRIES, dict[str, Path](), list[Path]()
    for place, folders, files in os.walk(folder):
        here = Path(place)
        folders[:] = sorted((name for name in folders if name[0] != "."), key=natural_sort_key)
        num_left -= len(folders) + len(files)
        if num_left < 0:
            raise InputError(
                "this folder holds too many files to be searched for a volume",
                where=str(folder),
                expected=f"at most {_MAX_ENTRIES} files and folders",
                hint="name the volume itself",
            )
        if here != folder and is_store(here):
            found[place] = here
            folders.clear()
            continue
        slices = _slices_below(here)
        if slices == "pictures":
            pictures.append(here)
        elif slices is not None and here != folder:
            found[place] = here
            continue
        own = set(_volumes_of_frames(here)) if slices is None else set()
        for file in map(here.joinpath, sorted(files, key=natural_sort_key)):
            if file in own or _is_volume(file):
                found.setdefault(os.path.realpath(file), file)
    return list(found.values()) or pictures


def _slices_below(folder: Path) -> Format | None:
    with suppress(InputError):
        return _format_of_slices(folder)
    return "dicom"  # the folder has slices of TIFF and DICOM, which the reader reports


def _is_volume(file: Path) -> bool:
    """Return whether a file is a volume: by its name, or by its first bytes too if other files share such names."""
    name = file.name.lower()
    is_certain = name.endswith(VOLUME_SUFFIXES)
    if name.startswith(".") or not (is_certain or name.endswith(_SHARED_SUFFIXES)):
        return False
    return file.is_file() and (is_certain or _format_by_bytes(file) is not None)  # reading a pipe might never end


def _start(path: Path) -> bytes:
    try:
        if path.stat().st_size == 0:  # reading a special file of the kernel, whose size is 0, might never end
            return b""
        with path.open("rb") as file:
            return file.read(_FIRST_BYTES)
    except OSError as error:
        raise InputError("cannot read this file", where=str(path), got=error.strerror) from error


def read_start(path: Path, num_bytes: int) -> tuple[bytes, bool]:
    """Return the first bytes of a file, decompressed if it is gzip, and whether it is gzip.

    A damaged gzip file may give fewer bytes.
    """
    start = _start(path)
    if start[:2] != _GZIP:
        return start[:num_bytes], False
    content = b""
    try:
        while start and len(content) < num_bytes:  # a gzip file may have several members, each of any length
            stream = zlib.decompressobj(zlib.MAX_WBITS | 16)
            content += stream.decompress(start, num_bytes - len(content))
            start = stream.unused_data
    except zlib.error:  # the damage may be in padding, behind the bytes that are needed
        pass
    return content, True


def _begins_like_dicom(start: bytes) -> bool:
    if start[128:132] == b"DICM":
        return True
    field = _FIRST_FIELD.match(start)
    return field is not None and (field["length"] is None or start[8 + field["length"][0] :].startswith(b"\x08\0"))
