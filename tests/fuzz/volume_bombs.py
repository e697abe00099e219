"""Small files that ask for much work or memory: streams that inflate, counts that lie, deep nesting, entities.

Those that are refused with a message of their own are in tests/messages/test_volume_messages.py.
"""

from __future__ import annotations

import bz2
import gzip
import struct
import zlib
from collections.abc import Callable
from functools import cache

# The content of files by their names, the first of which is opened, or its folder; with a length, zeros follow.
Files = dict[str, bytes | tuple[bytes, int]]

NRRD = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: {sizes}\nencoding: {encoding}\n{more}\n"
META = "ObjectType = Image\nNDims = 3\nDimSize = {sizes}\nElementType = MET_UCHAR\n{more}ElementDataFile = LOCAL\n"


@cache
def zeros_by_deflate(num_mebibytes: int) -> bytes:
    """Return a deflate stream of zeros: a block of them again and again."""
    deflate = zlib.compressobj(9, zlib.DEFLATED, -15)
    deflate.compress(bytes(2**16))
    deflate.flush(zlib.Z_FULL_FLUSH)
    block = deflate.compress(bytes(2**24)) + deflate.flush(zlib.Z_FULL_FLUSH)
    empty = zlib.compressobj(9, zlib.DEFLATED, -15)
    return block * (num_mebibytes // 16) + empty.compress(b"") + empty.flush()


@cache
def zeros_by_gzip(num_mebibytes: int) -> bytes:
    """Return a gzip member of zeros, whose checksum is wrong."""
    return gzip.compress(b"", mtime=0)[:10] + zeros_by_deflate(num_mebibytes) + bytes(8)


@cache
def zeros_by_bzip2(num_mebibytes: int) -> bytes:
    """Return bzip2 streams of zeros."""
    return bz2.compress(bytes(2**24)) * (num_mebibytes // 16)


def _nrrd(data: bytes = b"", *, sizes: str = "4 4 4", encoding: str = "raw", more: str = "") -> Files:
    return {"a.nrrd": NRRD.format(sizes=sizes, encoding=encoding, more=more).encode() + data}


def nrrd_listed_missing_files() -> Files:
    header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 1 1 2000000\nencoding: raw\ndata file: LIST 2\n"
    return {"a.nrrd": header.encode() + b"c\n" * 2_000_000}


def nrrd_numbered_files() -> Files:
    header = (
        "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 1 1 999999999\nencoding: raw\ndata file: b%d 1 999999999 1\n\n"
    )
    return {"a.nrrd": header.encode(), "b1": b"1"}


def _meta(data: bytes = b"", *, sizes: str = "4 4 4", more: str = "") -> Files:
    return {"a.mha": META.format(sizes=sizes, more=more).encode() + data}


ZLIB = b"\x78\x9c"


def metaimage_compressed_size_lies() -> Files:
    size = "CompressedData = True\nCompressedDataSize = 999999999999999999\n"
    return _meta(ZLIB + zeros_by_deflate(64), more=size)


def _nifti_header(
    *, offset: float = 352, sizes: tuple[int, ...] = (3, 4, 4, 4, 1, 1, 1, 1), extended: int = 0
) -> bytes:
    header = bytearray(352)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, *sizes)
    struct.pack_into("<hh", header, 70, 2, 8)
    struct.pack_into("<8f", header, 76, *[1.0] * 8)
    struct.pack_into("<f", header, 108, offset)
    header[344:348] = b"n+1\0"
    header[348] = extended
    return bytes(header)


def nifti_extension_of_gigabytes() -> Files:
    """Return a file of zeros with room for an extension of 2 GB before the voxels."""
    start = _nifti_header(offset=2.0**31, extended=1) + struct.pack("<ii", 2**31 - 512, 6)
    return {"a.nii": (start, 2**31 + 2**20)}


def nifti_many_extensions() -> Files:
    extension = struct.pack("<ii", 16, 6) + bytes(8)
    return {
        "a.nii.gz": gzip.compress(
            _nifti_header(offset=352 + 2**25, extended=1) + extension * 2**21 + bytes(64), 1, mtime=0
        )
    }


def nifti_extension_of_a_pair() -> Files:
    start = _nifti_header(offset=0, extended=1).replace(b"n+1", b"ni1") + struct.pack("<ii", 2**31 - 512, 6)
    return {"a.hdr": (start, 2**31 + 2**20), "a.img": bytes(64)}


def nested_sequences(depth: int) -> bytes:
    """Return sequences inside each other, of undefined length, in explicit little endian."""
    start = b"\x08\x00\x40\x11SQ\0\0\xff\xff\xff\xff\xfe\xff\x00\xe0\xff\xff\xff\xff"
    end = b"\xfe\xff\x0d\xe0\0\0\0\0\xfe\xff\xdd\xe0\0\0\0\0"
    return start * depth + end * depth


def nifti_dicom_in_an_extension() -> Files:
    nested = nested_sequences(3000)
    size = -(-(len(nested) + 8) // 16) * 16
    extension = struct.pack("<ii", size, 2) + nested.ljust(size - 8, b"\0")
    return {"a.nii": _nifti_header(offset=352 + size, extended=1) + extension + bytes(64)}


def npy_header(shape: str, descr: str = "'<u2'", *, length: int | None = None, version: int = 1) -> bytes:
    header = f"{{'descr': {descr}, 'fortran_order': False, 'shape': ({shape})}}\n".encode()
    size = len(header) if length is None else length
    return b"\x93NUMPY" + bytes((version, 0)) + size.to_bytes(2 if version == 1 else 4, "little") + header


def zip_archive(content: bytes, *, size: int, name: str = "a.npy", method: int = 8, checksum: int = 0) -> bytes:
    """Return an archive with one member, whose content is compressed already. A checksum of 0 is wrong."""
    common = struct.pack("<HHHHIII", 0, method, 0, 33, checksum, len(content), size)
    local = b"PK\3\4" + struct.pack("<H", 20) + common + struct.pack("<HH", len(name), 0) + name.encode()
    rest = struct.pack("<HHHHHII", len(name), 0, 0, 0, 0, 0, 0) + name.encode()
    central = b"PK\1\2" + struct.pack("<HH", 20, 20) + common + rest
    sizes = struct.pack("<IIH", len(central), len(local) + len(content), 0)
    return local + content + central + b"PK\5\6" + struct.pack("<HHHH", 0, 0, 1, 1) + sizes


def deflated(data: bytes) -> bytes:
    """Return a whole deflate stream."""
    deflate = zlib.compressobj(6, zlib.DEFLATED, -15)
    return deflate.compress(data) + deflate.flush()


def stored_block(data: bytes) -> bytes:
    """Return a block of deflate that is not compressed, and not the last."""
    return b"\0" + struct.pack("<HH", len(data), ~len(data) & 0xFFFF) + data


def npz_inflates_behind_its_array() -> Files:
    start = stored_block(npy_header("4, 4, 4") + bytes(128))
    return {"a.npz": zip_archive(start + zeros_by_deflate(4096), size=2**32 - 1)}


def _cube(atoms: str, rest: bytes) -> Files:
    return {"a.cube": f"a\nb\n{atoms} 0 0 0\n".encode() + b"4 1 0 0\n" * 3 + rest}


# By format and name.
BOMBS: dict[str, dict[str, Callable[[], Files]]] = {
    "nrrd": {
        "gzip_inflates": lambda: _nrrd(zeros_by_gzip(4096), encoding="gzip"),
        "gzip_inflates_before_its_voxels": lambda: _nrrd(zeros_by_gzip(32768), encoding="gzip",
            more="byte skip: 999999999999\n"),
        "bzip2_inflates": lambda: _nrrd(zeros_by_bzip2(2**16), encoding="bzip2"),
        "bzip2_inflates_before_its_voxels": lambda: _nrrd(zeros_by_bzip2(2**16), encoding="bzip2",
            more="byte skip: 999999999999\n"),
        "bzip2_claims_a_gigabyte": lambda: _nrrd(bz2.compress(bytes(1000)), sizes="4096 4096 400", encoding="bzip2"),
        "gzip_of_no_bytes": lambda: _nrrd(gzip.compress(b"", mtime=0) * 500_000, encoding="gzip"),
        "bzip2_of_no_bytes": lambda: _nrrd(bz2.compress(b"") * 500_000, encoding="bzip2"),
        "text_of_blanks": lambda: _nrrd(b" " * 2**25, encoding="text"),
        "hex_of_blanks": lambda: _nrrd(b" " * 2**25, encoding="hex"),
        "text_of_one_word": lambda: _nrrd(b"1" * 2**22, encoding="text"),
        "sizes_beyond_memory": lambda: _nrrd(zeros_by_gzip(1024), sizes="4096 4096 4096", encoding="gzip"),
        "comments": lambda: {"a.nrrd": b"NRRD0004\n" + b"#\n" * 2_000_000},
        "keys": lambda: {"a.nrrd": b"NRRD0004\n" + b"a:=b\n" * 800_000},
        "vectors": lambda: _nrrd(bytes(64), more="space directions: " + "(1,0,0) " * 500_000 + "\n"),
        "origins": lambda: _nrrd(bytes(64), more="space origin: " + "(1)" * 1_300_000 + "\n"),
        "spacings": lambda: _nrrd(bytes(64), more="spacings: " + "1 " * 2_000_000 + "\n"),
        "parentheses": lambda: _nrrd(bytes(64), more="space directions: " + "(" * 4_000_000 + "\n"),
        "blanks_in_a_name": lambda: _nrrd(bytes(64), more="spac" + " " * 100_000 + "ings: 1 1\n"),
        "listed_missing_files": nrrd_listed_missing_files,
        "numbered_files": nrrd_numbered_files,
        "long_name_of_a_data_file": lambda: _nrrd(more=f"data file: {'x/' * 100_000}\n"),
    },
    "metaimage": {
        "zlib_inflates": lambda: _meta(ZLIB + zeros_by_deflate(4096), more="CompressedData = True\n"),
        "compressed_size_lies": metaimage_compressed_size_lies,
        "continued_lines": lambda: {"a.mha": b"ObjectType = Image\nNDims = 3\n" + b"1\n" * 500_000},
        "words": lambda: _meta(bytes(64), more="Offset = " + "1 " * 2_000_000 + "\n"),
        "comments": lambda: _meta(bytes(64), more="Comment = a\n" * 300_000),
        "other_keys": lambda: _meta(bytes(64), more="".join(f"k{k} = 1\n" for k in range(400_000))),
        "channels": lambda: _meta(bytes(64), more="ElementNumberOfChannels = 999999999999\n"),
        "text_of_blanks": lambda: _meta(b" " * 2**25, more="BinaryData = False\n"),
    },
    "nifti": {
        "gzip_inflates": lambda: {"a.nii.gz": gzip.compress(_nifti_header(), mtime=0) + zeros_by_gzip(4096)},
        "name_in_gzip": lambda: {"a.nii.gz": b"\x1f\x8b\x08\x08" + bytes(6) + b"a" * 2**25},
        "name_in_gzip_before_sniffing": lambda: {"a": b"\x1f\x8b\x08\x08" + bytes(6) + b"a" * 2**25},
        "extension_of_gigabytes": nifti_extension_of_gigabytes,
        "many_extensions": nifti_many_extensions,
        "extension_of_a_pair": nifti_extension_of_a_pair,
        "dicom_in_an_extension": nifti_dicom_in_an_extension,
        "huge_sizes": lambda: {"a.nii.gz": gzip.compress(_nifti_header(sizes=(3, 32767, 32767, 500, 1, 1, 1,
            1)) + bytes(1000), mtime=0)},
    },
    "npy": {
        "nested_types": lambda: {"a.npy": npy_header("4, 4, 4", "[('a', " * 900 + "'<u2'" + ")]" * 900) + bytes(128)},
        "nested_parentheses": lambda: {"a.npy": npy_header("(" * 9000 + "4" + ")" * 9000) + bytes(128)},
        "long_types": lambda: {"a.npy": npy_header("4, 4, 4", "'<U999999999'") + bytes(128)},
        "long_shape": lambda: {"a.npy": npy_header("4, 4, " + "9" * 4000) + bytes(128)},
        "powers": lambda: {"a.npy": npy_header("4, 4, 9**9**9") + bytes(128)},
        "sparse": lambda: {"a.npy": (npy_header("1000, 1000, 500"), 2**30 + 2**20)},
    },
    "npz": {
        "inflates_behind_its_array": npz_inflates_behind_its_array,
        "claims_gigabytes": lambda: {
            "a.npz": zip_archive(stored_block(npy_header("1000, 1000, 2000")) + zeros_by_deflate(64), size=2**32 - 1)
        },
        "lzma_of_a_huge_window": lambda: {"a.npz": zip_archive(b"\x09\x04\x05\x00\x5d\xff\xff\xff\xff" + bytes(100),
            size=1000, method=14)},
        "bzip2_inflates": lambda: {"a.npz": zip_archive(zeros_by_bzip2(4096), size=2**32 - 1, method=12)},
    },
    "cube": {
        "atoms_beyond_floats": lambda: _cube("1e300", b"1 " * 64),
        "blanks": lambda: _cube("0", b" " * 2**25),
    },
}  # fmt: skip
