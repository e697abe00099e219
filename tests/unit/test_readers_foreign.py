"""Files that are no volumes, or of formats that are not read: each is named for what it is, and no other file is."""

from __future__ import annotations

import gzip
import io
import pickle
import re
import shlex
import tarfile

import nrrd
import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image
from scipy.io import savemat
from volume_files import NIBABEL, in_memory, ramp, read, refused, written, zipped

from hsplat_cli.commands.info import info
from renderer.readers import UnknownFormatError

VALUES = ramp("int16")


def _packed(data: bytes) -> bytes:
    return gzip.compress(data, mtime=0)  # without the time, which would be in the names of tests


def tar_of(name):
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w") as archive:
        archive.addfile(tarfile.TarInfo(name))
    return out.getvalue()


PICTURE = Image.fromarray(VALUES[0].astype(np.uint8))
FOREIGN = [
    ("a.vdb", b" BDV" + bytes(60), "an OpenVDB grid", "numpy.save"),
    ("a.mat", in_memory(savemat, {"v": VALUES}), "a MATLAB file of version 5", "-v7.3"),
    ("a.nc", b"CDF\x01" + bytes(60), "netCDF of the classic kind", "nccopy -k netCDF-4 a.nc"),
    ("a.mnc", b"CDF\x01" + bytes(60), "a MINC image", "mnc2nii a.mnc"),
    ("a.czi", b"ZISRAWFILE" + bytes(60), "a Zeiss CZI image", "bfconvert a.czi"),
    ("a.nd2", b"\xda\xce\xbe\x0a" + bytes(60), "a Nikon ND2 image", "bfconvert"),
    ("a.lif", b"p\0\0\0" + bytes(60), "an image of a microscope", "bfconvert"),
    ("a.oib", b"\xd0\xcf\x11\xe0" + bytes(60), "an image of a microscope", "bfconvert"),
    ("a.zip", zipped(["a.dcm"]), "a zip archive", "unpack it"),
    ("a.xlsx", zipped(["[Content_Types].xml"]), "a document of an office program", "no voxels"),
    ("a.7z", b"7z\xbc\xaf\x27\x1c" + bytes(60), "a 7z archive", "unpack it"),
    ("a.rar", b"Rar!\x1a\x07\x01\0", "a rar archive", "unpack it"),
    ("a.tar", tar_of("a.dcm"), "a tar archive", "unpack it"),
    ("a.tar.gz", _packed(tar_of("a.dcm")), "a tar archive", "unpack it"),
    ("a.nii.gz", b"version https://git-lfs.github.com/spec/v1\noid", "a pointer of git-lfs", "git lfs pull"),
    ("a.mha", b"/annex/objects/SHA256E-s99--0f.mha\n", "a pointer of git-annex", "git annex get a.mha"),
    ("a.nii.gz", b"<!DOCTYPE html><html><body>404", "a web page", "download the file again"),
    ("a.nrrd", b"\n<html><head>", "a web page", "download the file again"),
    ("a.sgy", b"\xc3\x40" * 1600, "SEG-Y", "segyio"),
    ("a.am", b"# AmiraMesh BINARY-LITTLE-ENDIAN 2.1\n", "an Amira or Avizo file", "save it as NRRD"),
    ("a.pdf", b"%PDF-1.7\n", "a PDF document", "no voxels"),
    ("a.mp4", b"\0\0\0\x18ftypmp42", "a film", "no voxels"),
    ("a.gif", in_memory(PICTURE.save, "gif"), "a GIF", "no voxels"),
    ("a.png", in_memory(PICTURE.save, "png"), "a picture", "a folder of such slices is a volume"),
    ("a.jpg", in_memory(PICTURE.save, "jpeg"), "a picture", "a folder of such slices is a volume"),
    ("a.bmp", in_memory(PICTURE.save, "bmp"), "a picture", "a folder of such slices is a volume"),
    ("a.pkl", pickle.dumps([1, 2]), "a pickle of Python", "never loaded"),
    ("a.pkl", pickle.dumps(VALUES), "a pickle of Python", "never loaded"),
    ("a.fits", b"SIMPLE  =                    T", "FITS", "astropy.io.fits"),
    ("a.pdb", b"HEADER    HYDROLASE\nATOM      1  N", "a molecule", "ChimeraX"),
    ("a.xyz", b"3\nwater\nO 0 0 0\n", "a molecule", "ChimeraX"),
    ("a.stl", b"solid x\nfacet normal 0 0 1\n", "a surface", "no voxels"),
    ("a.obj", b"v 0 0 0\nv 1 0 0\n", "a surface", "no voxels"),
    ("a.ply", b"ply\nformat ascii 1.0\n", "a surface", "no voxels"),
    ("a.psd", b"8BPS\0\x01", "a picture of Photoshop", "save its layers"),
    ("a.jp2", b"\0\0\0\x0cjP  \r\n\x87\n", "a JPEG 2000 picture", "opj_decompress"),
    ("a.dx", b"object 1 class gridpositions counts 2 2 2\n", "an OpenDX grid", "MRC"),
    ("a.HEAD", b"type = string-attribute\n", "an AFNI dataset", "3dAFNItoNIFTI a.HEAD"),
    ("a.mif", b"mrtrix image\ndim: 4,4,4\n", "an MRtrix image", "mrconvert a.mif"),
    ("a.dcm.gz", _packed(bytes(128) + b"DICM" + bytes(60)), "a file of DICOM, compressed by gzip", "gunzip"),
    ("b.dcm.gz", _packed(b"\x5c\x01" + bytes(126) + b"DICM" + bytes(300)), "a file of DICOM, compressed", "gunzip"),
    ("a.nrrd.gz", _packed(b"NRRD0004\ntype: short\n"), "a file of NRRD, compressed by gzip", "gunzip a.nrrd.gz"),
    ("a.raw.gz", _packed(bytes(60)), "a file of unknown content, compressed by gzip", "gunzip a.raw.gz"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "data", "what", "hint"), FOREIGN, ids=lambda each: str(each)[:20])
def test_files_are_named_for_what_they_are(tmp_path, name, data, what, hint):
    error = refused(written(tmp_path / name, data), match=f"this is {what}")
    assert hint in error.hint and error.where == str(tmp_path / name)
    assert "damaged" not in str(error) and max(map(len, str(error).splitlines())) < 400
    assert not isinstance(error, UnknownFormatError)


POINTERS = [row for row in FOREIGN if row[2].startswith("a pointer")]


@pytest.mark.parametrize(("pointer", "what", "hint"), [row[1:] for row in POINTERS])
@pytest.mark.parametrize(("header", "data"), [("a.nhdr", "a.raw"), ("a.mhd", "a.raw"), ("a.hdr", "a.img")])
def test_pointers_in_place_of_data_files_are_named(tmp_path, header, data, pointer, what, hint):
    if header == "a.nhdr":
        nrrd.write(str(tmp_path / header), VALUES, {"encoding": "raw"}, detached_header=True)
    elif header == "a.mhd":
        fields = (
            "NDims = 3\nDimSize = 5 4 3\nElementType = MET_SHORT\nElementSpacing = 1 1 1\nElementDataFile = a.raw\n"
        )
        written(tmp_path / header, fields.encode())
    else:
        NIBABEL.Nifti1Pair(VALUES, np.eye(4)).to_filename(tmp_path / header)
    written(tmp_path / data, pointer)
    error = refused(tmp_path / header, match=f"this is {what}")
    assert hint.split()[1] in error.hint and error.where == str(tmp_path / data)


def test_links_of_git_annex_are_named(tmp_path):
    (tmp_path / "a.nii.gz").symlink_to("../.git/annex/objects/0f/1e/SHA256E-s99--0f.nii.gz")
    error = refused(tmp_path / "a.nii.gz", match="a link of git-annex to a file that is not here")
    assert "git annex get a.nii.gz" in error.hint


@pytest.mark.parametrize(
    ("name", "dtype", "options"),
    [
        ("head_5x4x3_uint16.raw", "<u2", "--shape 5,4,3 --dtype uint16"),
        ("5x4x3-i16-be.bin", ">i2", "--shape 5,4,3 --dtype int16 --byte-order big"),
        ("ct.5_4_3_float.dat", "<f4", "--shape 5,4,3 --dtype float32"),
        ("a5X4X3.raw", "u1", "--shape 5,4,3 --dtype uint8"),
        ("v 5x4x3 32bit.raw", "<f4", "--shape 5,4,3 --dtype float32"),
    ],
)
def test_names_with_a_shape_give_the_whole_command(tmp_path, name, dtype, options):
    ramp(dtype).tofile(tmp_path / name)
    error = refused(tmp_path / name, match="this is not a volume in a known format")
    assert error.declaration is not None and f"file: {name}" in error.hint
    told = CliRunner().invoke(info, [str(tmp_path / name)]).exception
    command = re.search("`hsplat info (.*)`", told.hint)[1]
    assert command.endswith(options)
    shown = CliRunner().invoke(info, shlex.split(command))
    assert shown.exit_code == 0 and f"  values       {ramp(dtype).min():.0f} to" in shown.output


@pytest.mark.parametrize("name", ["5x4x4_uint8.raw", "5x4x3_int16.raw", "1.5x4x3_uint8.raw", "25x4_uint8.raw", "v.raw"])
def test_names_that_do_not_fit_the_size_give_none(tmp_path, name):
    ramp("uint8").tofile(tmp_path / name)
    assert refused(tmp_path / name, match="this is not a volume in a known format").declaration is None


def test_other_files_are_of_no_known_format(tmp_path):
    for data in (b"some text\n", bytes(5000), np.random.default_rng(1).bytes(5000)):
        error = refused(written(tmp_path / "a.bin", data), match="this is not a volume in a known format")
        assert isinstance(error, UnknownFormatError)
    np.savez(tmp_path / "a.zip", VALUES)  # the content decides
    (tmp_path / "a.zip.npz").rename(tmp_path / "a.zip")
    np.testing.assert_array_equal(read(tmp_path / "a.zip").values, VALUES)
