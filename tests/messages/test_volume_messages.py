"""Messages about volumes that cannot be read; no library's words are among them."""

from __future__ import annotations

import gzip
import os
from pathlib import Path

import nibabel as nib
import numpy as np
import pytest
import tifffile
from message_scenes import SCAN_SCENE
from tiff_files import COMPRESSION, SHORT, tiff
from transcripts import Case, cases
from volume_bombs import npy_header
from volume_files import read, refused, write_image, zipped

VALUES = np.arange(60, dtype=np.uint16).reshape(3, 4, 5)
NRRD = "NRRD0004\ntype: uint16\ndimension: 3\nsizes: 5 4 3\nendian: little\nencoding: raw\n"
META = "NDims = 3\nDimSize = 5 4 3\nElementType = MET_USHORT\nElementDataFile = LOCAL\n"
# Lines of a MetaImage header that do not have their numbers, by the name of the file.
META_LINES = {
    "no-length": "ElementSpacing = 0 1 1", "no-number": "ElementSpacing = nan 1 1", "no-size": "ElementSize = 1 1 -inf",
    "too-few": "DimSize = 5 4", "no-counts": "DimSize = 5 4 -3", "parts": "DimSize = 5 4 2.5",
    "no-axes": "NDims = three", "no-origin": "Offset = nan 0 0", "half-an-origin": "Position = 0 0",
    "flat": "TransformMatrix = 1 0 0 0 1 0 0 0 0", "digits": f"TransformMatrix = {6 * '0.90630778703664994 '}0 0 0",
    "bell": "Offset = \a 0 0", "axis-twice": "TransformMatrix = 1 0 0 0 1 0 1 0 0",
}  # fmt: skip

LARGE = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: {}\nencoding: {}\n{}\n"
LARGE_META = "ObjectType = Image\nNDims = 3\nDimSize = {}\nElementType = MET_UCHAR\nElementDataFile = {}\n"
BEYOND = "1e300 2 1e300"
# A line of 16 bytes before the voxels.
LINE = b" " * 15 + b"\n"
CUBE = "a\nb\n{} 0 0 0\n2 1 0 0\n2 0 1 0\n2 0 0 1\n"


def array(shape: str) -> bytes:
    """Return an array file whose header has this shape."""
    return npy_header(shape) + bytes(1000)


def packed(lines: str, *, encoding: str = "gzip", data: bytes = gzip.compress(bytes(8))) -> bytes:
    """Return an NRRD file of 2 x 2 x 2 voxels with these lines in its header."""
    return LARGE.format("2 2 2", encoding, lines).encode() + data


# A header of 4 GiB, which is not there.
LONG_HEADER = b"\x93NUMPY\2\0" + np.uint32(2**32 - 1).tobytes()
# Files that ask for more than a volume can have, by name.
EXCESSIVE = {
    "negative.npy": array("-2, -3, 10"), "booleans.npy": array("True, True, 64"), "axes.npy": array("1, " * 100),
    "nested.npy": array("-" * 9000 + "6, 7, 8"), "beyond.nrrd": LARGE.format(BEYOND, "raw", "").encode(),
    "beyond.mha": LARGE_META.format(BEYOND, "LOCAL").encode(),
    "beyond.cube": CUBE.format(0).replace("2 1 0 0", "1e300 1 0 0").replace("2 0 0 1", "1e300 0 0 1").encode() + b"1\n",
    "beyond.mhd": LARGE_META.format(BEYOND, "LIST\nb\nc").encode(), "blanks.nrrd": packed(f"spac{' ' * 9999}ings: 1\n"),
    "origins.nrrd": packed("space origin:" + "(1,1,1)" * 9 + "\n"),
    "bytes-to-skip.nrrd": packed("byte skip: 67108865\n"),
    "lines-to-skip.nrrd": packed("line skip: 9999999\n", encoding="raw", data=LINE * 2**18 + bytes(8)),
    "lines-to-skip-packed.nrrd": packed("line skip: 9999999\n", data=LINE * 2**18 + bytes(8)),
    "infinite-directions.nrrd": packed("space: RAS\nspace directions: (inf,0,0) (0,1,0) (0,0,1)\n"),
    "infinite-spacings.nrrd": packed("spacings: inf 1 1\n"),
    "long-word.nrrd": packed("", encoding="text", data=b"1 " * 8 + b"x" * 5000),
    "pieces.nhdr": LARGE.format("1 1 99999", "raw", "data file: LIST").encode() + b"piece\n" * 99_999,
    "pieces.mhd": LARGE_META.format("1 1 99999", "LIST").encode() + b"piece\n" * 99_999,
    "many.npz": zipped([f"{'long' * 20} {k}.npy" for k in range(50)]),
    "no-encoding.npz": zipped(["\u00e4\u00f6.npy"]).replace("\u00e4\u00f6".encode(), b"\xff\xfe\xff\xfe"),
    "long.npy": LONG_HEADER, "long.npz": zipped(["a.npy"], LONG_HEADER),
    "atoms.cube": f"{CUBE.format(999999999)}{2**18 * chr(10)}{8 * '1 '}".encode(),
    "orbitals.cube": f"{CUBE.format(-1)}0\n999999999{2**18 * chr(10)}{8 * '1 '}".encode(),
}  # fmt: skip


@pytest.fixture(scope="module")
def files(module_folder: Path) -> Path:
    """A folder of volumes, most of them with one fault."""
    Path("scene.yaml").write_text(SCAN_SCENE, "utf-8")
    os.mkfifo("pipe.npy")
    for name in ("empty.nrrd", "empty.nii", "empty.tif", "empty.npy", "empty.mha"):
        Path(name).touch()
    Path("text.vol").write_bytes(b"hello")
    Path("piece").write_bytes(b"1")
    for name, content in EXCESSIVE.items():
        Path(name).write_bytes(content)
    write_arrays()
    write_images()
    write_headers()
    return module_folder


def write_arrays() -> None:
    np.save("scan.npy", VALUES)
    Path("short.npy").write_bytes(Path("scan.npy").read_bytes()[:-1])
    with_nan = VALUES.astype(np.float32)
    with_nan[1, 2, 3] = with_nan[2, 0, 0] = np.nan
    for name, values in {
        "nan": with_nan,
        "half": with_nan.astype(np.float16),
        "inf": np.full((2, 2, 2), np.inf),
        "four": np.zeros((2, 3, 4, 5)),
        "single": np.float32(1),
        "none": np.zeros((3, 0, 4)),
        "large": 2**60 + VALUES.astype(np.int64),
        "complex": np.zeros((2, 2, 2), complex),
        "records": np.zeros((2, 2, 2), [("a", "u1"), ("b", "f4")]),
        "objects": np.zeros((2, 2, 2), object),
    }.items():
        np.save(f"{name}.npy", values)
    for name, damage in {"header": slice(10, 40), "brackets": slice(60, 70), "bracket": slice(20, 21)}.items():
        data = bytearray(Path("scan.npy").read_bytes())
        data[damage] = b"(" * len(data[damage])
        Path(f"{name}.npy").write_bytes(data)
    Path("bare.raw").write_bytes(bytes(160))


def write_images() -> None:
    """Write volumes by their libraries, and remove or change a part of them."""
    for name in ("lonely.nhdr", "lonely.mhd", "cut.nhdr", "cut.nrrd", "cut.mha", "cut.nii", "cut.tif"):
        write_image(Path(name), VALUES)
    Path("lonely.raw").unlink()
    Path("cut.raw").write_bytes(bytes(3))
    for name in ("cut.nrrd", "cut.mha", "cut.nii"):
        Path(name).write_bytes(Path(name).read_bytes()[:-7])
    Path("cut.tif").write_bytes(Path("cut.tif").read_bytes()[:400])
    with tifffile.TiffWriter("pages.tif") as pages:
        pages.write(VALUES[0], photometric="minisblack")
        pages.write(VALUES[1, :2], photometric="minisblack")
    nib.Nifti1Pair(VALUES, np.eye(4)).to_filename("half.hdr")
    Path("half.img").unlink()
    nifti = nib.Nifti1Image(VALUES, np.eye(4))
    nifti.header.set_sform(np.diag([np.nan, 1, 1, 1]), 1)
    nifti.header["pixdim"][1:4] = np.nan
    nib.Nifti1Image(VALUES, None, nifti.header).to_filename("nan.nii")
    write_image(Path("times.mha"), np.zeros((7, 3, 4, 5), np.uint8))
    write_image(Path("colours.mha"), np.zeros((3, 4, 5, 3), np.uint8), has_components=True)
    for folder in ("nothing", "widths", "several"):
        Path(folder).mkdir()
        for k, width in enumerate((5, 5, 6) if folder == "widths" else (5, 5) if folder == "several" else ()):
            write_image(Path(f"{folder}/{k}.tif"), np.zeros((4, width), np.uint8))
    write_image(Path("several/2.tif"), np.zeros((2, 4, 5), np.uint8))
    write_image(Path("whole.mhd"), VALUES)
    lines = Path("whole.mhd").read_text().splitlines()
    for name, line in META_LINES.items():
        key = {"Position": "Offset", "ElementSize": "ElementSpacing"}.get(line.split()[0], line.split()[0])
        kept = [each for each in lines if each.split()[0] != key]
        assert len(kept) == len(lines) - 1
        Path(f"{name}.mhd").write_text("\n".join([*kept[:2], line, *kept[2:]]) + "\n")


def write_headers() -> None:
    """Write files byte by byte."""
    packed, gzip_header = gzip.compress(VALUES.tobytes()), NRRD.replace("raw", "gzip")
    voxels, axes = bytes(8), "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nspace dimension: 3\nencoding: raw\n"
    for name, header, data in (
        ("checksum", gzip_header, packed[:-4] + bytes(4)),
        ("broken-off", gzip_header, packed[:-1]),
        ("too-little", gzip_header, gzip.compress(bytes(100))),
        ("half", NRRD.replace("uint16", "half"), b""),
        ("bzip2", NRRD.replace("raw", "bzip2"), b"BZh9"),
        ("huge", NRRD.replace("5 4 3", "100000 90000 80000"), b""),
        ("flat", f"{axes}space directions: (1,0,0) (1,0,0) (0,0,1)\n", voxels),
        ("no-length", f"{NRRD}spacings: NaN 1 2\n", VALUES.tobytes()),
        ("ten-axes", NRRD.replace("dimension: 3", "dimension: 10").replace("5 4 3", "1 " * 10), bytes(2)),
    ):
        Path(f"{name}.nrrd").write_bytes(f"{header}\n".encode() + data)
    Path("words.mha").write_bytes(f"BinaryData = False\n{META}".encode() + b"no digits " * 60)
    for number in (50000, 34925, 50001, 4321, 8):
        Path(f"{number}.tif").write_bytes(tiff({COMPRESSION: (SHORT, 1, number)}))
    nifti = nib.Nifti1Header()
    nifti.set_data_dtype(np.uint8)
    nifti["dim"][:4] = 3, -2, -2, 4
    nifti["vox_offset"] = 352
    Path("negative.nii").write_bytes(nifti.binaryblock + bytes(100))


@pytest.mark.usefixtures("one_process")
@cases("volumes.txt")
def test_messages(case: Case, files: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(files)
    case.check(capfd)


def message(name: str) -> str:
    return str(refused(Path(name)))


def raising(error: Exception):
    def fail(*_args):
        raise error

    return fail


@pytest.mark.parametrize(
    ("target", "replacement", "expected"),
    [
        ("os.access", lambda *_: False, "no permission to read this"),  # root may read everything
        ("numpy.memmap", raising(OSError(5, "Input/output error")), "cannot read this file\n  got: Input/output error"),
        (
            "renderer.readers.volume_reading._load",
            raising(MemoryError()),
            "there is not enough memory for this volume\n  hint: `crop` it, or render on a larger machine",
        ),
    ],
)
def test_errors_of_the_system(folder, monkeypatch, target, replacement, expected):
    np.save("a.npy", VALUES)
    monkeypatch.setattr(target, replacement)
    assert message("a.npy") == f"a.npy: {expected}"


def test_numbers_of_a_metaimage_may_stand_on_several_lines(folder):
    write_image(Path("a.mhd"), VALUES)
    text = Path("a.mhd").read_text().replace("1.0 0.0 0.0 0.0 1.0 0.0 0.0", "1 0 0\n0 1 0\n0")
    assert "0 1 0\n0 0.0 1" in text
    Path("a.mhd").write_text(text)
    np.testing.assert_array_equal(read(Path("a.mhd")).values, VALUES)


ASSUMED = "the file does not give its voxel size; 1 x 1 x 1 is assumed"


@pytest.mark.parametrize(
    ("name", "header", "spacing", "note"),
    [
        ("a.nrrd", f"{NRRD}\n", [1, 1, 1], ASSUMED),
        ("a.nrrd", f"{NRRD}space: LPS\nspace origin: (0,0,0)\n\n", [1, 1, 1], ASSUMED),
        ("a.mha", META, [1, 1, 1], ASSUMED),
        ("a.mha", f"elementspacing = 1 2 3\n{META}", [1, 1, 1], ASSUMED),  # no key of its reader's
        ("a.mha", META.replace("DimSize", "ElementSize = 1 1 1\nDimSize"), [1, 1, 1], None),
        (
            "a.nrrd",
            NRRD.replace(": 3", ": 4").replace("5 4 3", "1 5 4 3")
            + "spacings: NaN 1 2 3\nkinds: vector domain domain domain\n\n",
            [1, 2, 3],
            None,
        ),
    ],
)
def test_missing_lengths_are_1_and_noted(folder, name, header, spacing, note):
    Path(name).write_bytes(header.encode() + VALUES.tobytes())
    volume = read(Path(name))
    assert (volume.spacing.tolist(), volume.note) == (spacing, note)
    assert read(Path(name), (1.0, 1.0, 2.0)).note is None


# NRRD headers at which a reader that copies lines into buffers of a fixed size ended the process


@pytest.mark.parametrize(
    "line",
    [
        "x" * 1000,
        *(
            f"{name}: {'9' * 1000}"
            for name in (
                *("type", "encoding", "space", "kinds", "sizes", "spacings", "space directions", "space origin"),
                *("axis mins", "centers", "old min", "dimension", "endian", "byte skip"),
            )
        ),
    ],
)
@pytest.mark.parametrize("name", ["a.nrrd", "a.foo"])
def test_overlong_lines_are_errors_or_ignored(folder, name, line):
    field = line.partition(":")[0]
    kept = "".join(f"{each}\n" for each in NRRD.splitlines() if not each.startswith(f"{field}:"))
    Path(name).write_bytes(f"{kept}{line}\n\n".encode() + VALUES.tobytes())
    if field == "old min":
        np.testing.assert_array_equal(read(Path(name)).values, VALUES)
        return
    text = message(name)
    assert text.startswith(f"{name}:") and max(map(len, text.splitlines())) < 300


def test_comments_and_keys_may_be_long(folder):
    Path("a.nrrd").write_bytes(f"{NRRD}# {'x' * 5000}\nkey:={'x' * 5000}\n\n".encode() + VALUES.tobytes())
    np.testing.assert_array_equal(read(Path("a.nrrd")).values, VALUES)


@pytest.mark.parametrize("dimension", ["17", "+11", "11abc", "4294967307", "0", "-1", "abc", "3.5", "3 11"])
def test_dimensions_are_from_1_to_16(folder, dimension):
    text = NRRD.replace("dimension: 3", f"dimension: {dimension}").replace("5 4 3", "1 " * 11)
    Path("a.nrrd").write_text(text + "\n", "ascii")
    assert message("a.nrrd").startswith("a.nrrd:")


def test_paths_may_be_long(folder):
    file = Path(*["d" * 200] * 5, "a.nrrd")
    file.parent.mkdir(parents=True)
    file.write_bytes(NRRD.encode() + b"\n" + VALUES.tobytes())
    np.testing.assert_array_equal(read(file).values, VALUES)
