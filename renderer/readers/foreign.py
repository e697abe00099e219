"""Name files that are no volumes, or that other programs convert: by their first bytes, or by their names alone."""

from __future__ import annotations

import re
from pathlib import Path

from renderer.errors import InputError
from renderer.scene import short_text

_UNPACK = "unpack it, and name what is in it"
_MICROSCOPE = "`bfconvert FILE volume.ome.tif`, of Bio-Formats, makes a TIFF file of it"
_NIBABEL = "`python -c \"import nibabel as n; n.save(n.Nifti1Image.from_image(n.load('FILE')), 'volume.nii.gz')\"`"
_SURFACE = "it has surfaces and no voxels: ParaView or PyVista can fill it with voxels"
_ATOMS = "it has places of atoms and no voxels: ChimeraX can make a map of it (`molmap`), and save that as MRC"
_NO_VOXELS = "it holds no voxels"
_PICTURE = "a folder of such slices is a volume: put them into one, and name it"
_EXPORT = "open it in its own program, in Fiji or in 3D Slicer, and save it as NRRD or TIFF"
_AGAIN = "download the file again"

# What a file is, how it is converted or why it is no volume, and how it begins: patterns, of the whole of its start.
_BY_BYTES = (
    ("an OpenVDB grid", "fill a numpy array by `grid.copyToArray` of openvdb, and save it by `numpy.save`", rb" BDV"),
    ("a MATLAB file of version 5", "in MATLAB, `save('volume.mat', 'NAME', '-v7.3')` makes one that is read; or "
     '`python -c "import numpy, scipy.io; numpy.save(\'volume.npy\', scipy.io.loadmat(\'FILE\')[\'NAME\'].T)"`',
     rb"MATLAB 5"),
    ("netCDF of the classic kind", "`nccopy -k netCDF-4 FILE volume.nc` makes a netCDF-4 file, which is read",
     rb"CDF[\x01\x02\x05]"),
    ("HDF4", "`h4toh5convert FILE volume.h5` makes an HDF5 file, which is read", rb"\x0e\x03\x13\x01"),
    ("GRIB", "`cdo -f nc4 copy FILE volume.nc` makes a netCDF-4 file, which is read", rb"GRIB"),
    ("FITS", '`python -c "import numpy as n, astropy.io.fits as f; n.save(\'volume.npy\', f.getdata(\'FILE\'))"`',
     rb"SIMPLE  ="),
    ("a Zeiss CZI image", _MICROSCOPE, rb"ZISRAWFILE"),
    ("a Nikon ND2 image", _MICROSCOPE, rb"\xda\xce\xbe\x0a"),
    ("an MRtrix image", "`mrconvert FILE volume.nii.gz` makes a NIfTI file of it", rb"mrtrix image"),
    ("an ECAT image", _NIBABEL, rb"MATRIX7"),
    ("a PAR header of Philips", "`parrec2nii FILE` makes a NIfTI file of it", rb"# === DATA DESCRIPTION FILE"),
    ("an Amira or Avizo file", _EXPORT, rb"# (AmiraMesh|Avizo|HyperMesh|HyperSurface)"),
    ("a web page", f"it was saved in place of a file, as after a failed download: {_AGAIN}",
     rb"(?i)(\xef\xbb\xbf)?\s*(<!doctype html|<html)"),
    ("an answer of a server", f"it was saved in place of a file: {_AGAIN}", rb"(<\?xml[^>]*>)?\s*<Error>"),
    ("a pointer of git-lfs to a file", "`git lfs pull` fetches the file itself", rb"version https://git-lfs"),
    ("a 7z archive", _UNPACK, rb"7z\xbc\xaf\x27\x1c"),
    ("a rar archive", _UNPACK, rb"Rar!\x1a\x07"),
    ("a tar archive", _UNPACK, rb".{257}ustar"),
    ("a file compressed by bzip2", "`bunzip2 FILE` unpacks it", rb"BZh[1-9]"),
    ("a file compressed by xz", "`unxz FILE` unpacks it", rb"\xfd7zXZ\0"),
    ("a file compressed by Zstandard", "`unzstd FILE` unpacks it", rb"\x28\xb5\x2f\xfd"),
    ("a picture", _PICTURE, rb"\x89PNG|\xff\xd8\xff|BM.{4}\0\0\0\0"),
    ("a JPEG 2000 picture", "`opj_decompress -i FILE -o slice.tif` makes a TIFF file of it",
     rb"\0\0\0\x0cjP  |\xff\x4f\xff\x51"),
    ("a picture of Photoshop", "save its layers as TIFF", rb"8BPS"),
    ("a GIF", _NO_VOXELS, rb"GIF8"),
    ("a film", _NO_VOXELS, rb".{4}ftyp|\x1a\x45\xdf\xa3|RIFF.{4}AVI "),
    ("a PDF document", _NO_VOXELS, rb"%PDF"),
    ("a pickle of Python", "it is never loaded, as it could run any program: save the array by `numpy.save`",
     rb"\x80[\x02-\x05][\x95\]}(c]"),
    ("a surface (STL)", _SURFACE, rb"solid\s.{0,200}facet"),
    ("a surface (PLY)", _SURFACE, rb"ply\r?\n"),
    ("a surface (GIfTI)", _SURFACE, rb"(<\?xml.*)?<GIFTI"),
    ("a molecule (PDB)", _ATOMS,
     rb"(HEADER|CRYST1|REMARK|ATOM  )[ 0-9].{0,4000}\n(ATOM  |HETATM|TITLE |REMARK|COMPND)"),
    ("an Open Inventor or VRML scene", _SURFACE, rb"#(Inventor|VRML)"),
)  # fmt: skip
# By the end of the name, where bytes cannot tell.
_BY_NAME = {
    ".mnc": ("a MINC image", "`mnc2nii FILE volume.nii` makes a NIfTI file of it"),
    **dict.fromkeys((".sgy", ".segy"), ("SEG-Y", "`python -c \"import numpy, segyio; numpy.save('volume.npy', "
                                        "segyio.tools.cube('FILE').T)\"`")),
    **dict.fromkeys((".lif", ".oib", ".oif", ".zvi", ".vsi", ".scn", ".dm3", ".dm4", ".pic", ".stk"),
                    ("an image of a microscope", _MICROSCOPE)),
    ".dx": ("an OpenDX grid", "PyMOL, ChimeraX or VMD can save it as MRC (.map)"),
    **dict.fromkeys((".head", ".brik", ".brik.gz"),
                    ("an AFNI dataset", "`3dAFNItoNIFTI FILE` makes a NIfTI file of it")),
    **dict.fromkeys((".stl", ".obj", ".vtp", ".glb", ".gltf", ".fbx", ".3ds"), ("a surface", _SURFACE)),
    **dict.fromkeys((".xyz", ".cif", ".pdb"), ("a molecule, or a list of points", _ATOMS)),
    **dict.fromkeys((".xls", ".xlsx", ".doc", ".docx", ".ppt", ".pptx", ".odt", ".ods"),
                    ("a document of an office program", _NO_VOXELS)),
    ".isq": ("a Scanco image", _EXPORT),
    **dict.fromkeys((".txm", ".txrm", ".vgi", ".vgl", ".mvol"), ("data of another program", _EXPORT)),
    **dict.fromkeys((".xdmf", ".xmf"), ("an XDMF header", "name the HDF5 file that it describes")),
}  # fmt: skip
_BY_BYTES_COMPILED = tuple((what, hint, re.compile(pattern, re.DOTALL)) for what, hint, pattern in _BY_BYTES)
_ZARR = (".zarray", ".zgroup", "zarr.json")


def refuse_bytes(path: Path, start: bytes) -> None:
    """Raise InputError for a file that begins as one of a known kind that is not read."""
    refuse_name(path, {".mnc", ".xlsx", ".docx", ".pptx", ".odt", ".ods"})
    for what, hint, pattern in _BY_BYTES_COMPILED:
        if pattern.match(start):
            raise _foreign(path, what, hint)
    if start[:2] == b"PK" and path.suffix.lower() != ".npz" and not start[30:].partition(b".npy")[1]:
        raise _foreign(path, "a zip archive", _UNPACK)


def refuse_name(path: Path, names: set[str] | None = None) -> None:
    """Raise InputError for a file whose name ends as those of a kind that is not read. names: those that count."""
    for end, (what, hint) in _BY_NAME.items():
        if path.name.lower().endswith(end) and (names is None or end in names):
            raise _foreign(path, what, hint)


def refuse_folder(path: Path) -> None:
    """Raise InputError for a folder of Zarr."""
    if any((path / name).is_file() for name in _ZARR):
        hint = "`python -c \"import numpy, zarr; numpy.save('volume.npy', zarr.open('FILE/0', mode='r')[:])\"`"
        raise _foreign(path, "a Zarr array or group", hint)


def compressed_error(path: Path, content: str) -> InputError:
    """Return the error for gzip around what is read without it only. content: what that is, or is not known to be."""
    return _foreign(path, f"{content}, compressed by gzip", "`gunzip FILE` unpacks it")


def _foreign(path: Path, what: str, hint: str) -> InputError:
    shown = hint.replace("FILE", short_text(path.name))
    return InputError(f"this is {what}, which is not read", where=str(path), hint=shown)
