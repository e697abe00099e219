"""Find the files of a volume, and the marks by which a change of one of them is noticed."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

from renderer.errors import InputError
from renderer.readers.file_errors import errors_about
from renderer.readers.recent_images import FileMarks, marks_of
from renderer.readers.sniff import find_format

# The formats that large libraries parse, and that are read in a child process.
ISOLATED = ("tiff", "dicom", "vtk", "hdf5", "pictures")


def marks_of_volume(path: Path, form: str) -> tuple[FileMarks, ...]:
    """Return the marks of all files with a volume, as far as its header can be read."""
    marks = list[FileMarks]()
    with suppress(InputError):  # the reader tells what is wrong with a header
        # A large library may open any file beside the volume: the slices of its series, or the planes of OME-TIFF.
        marks.extend(marks_with_header(path, with_folder=form in ISOLATED))
    return tuple(marks)


def marks_with_header(path: Path, *, with_folder: bool = False) -> Iterator[FileMarks]:
    """Yield the marks of a file or a folder with a volume, and of all files that its header names.

    with_folder: whether the marks of all files in the folder of a file take the place of the marks of the file itself.
    Raises InputError for damaged headers.
    """
    yield marks_of(path.parent if with_folder and path.is_file() else path)
    if path.is_file():
        yield from map(marks_of, header_and_voxel_files(path)[1])


def header_and_voxel_files(file: Path) -> tuple[Path, list[Path]]:
    """Return the file of a volume's header, and the files of voxels that the header names, perhaps its own among them.

    Raises InputError for damaged headers and missing files.
    """
    form = find_format(file)
    if form in ("nrrd", "metaimage"):
        from renderer.readers import metaimage, nrrd

        with errors_about(file):
            layout = (nrrd.read_header(file) if form == "nrrd" else metaimage.read_header(file))[1]
            return file, [part.file for part in layout.parts]
    if form == "vtk":
        from renderer.readers.vtk_image import piece_files

        with errors_about(file):
            return file, piece_files(file)
    if form == "nifti":
        from renderer.readers.nifti import find_pair

        header, data = find_pair(file)
        return header, [data or header]
    return file, []
