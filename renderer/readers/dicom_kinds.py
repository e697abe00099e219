"""Recognise the kinds of DICOM files: images, files without pixels, tiles of slides, and runs.

The frames of a run are times of one plane, such as an X-ray film or an ultrasound clip.
"""

from __future__ import annotations

from itertools import accumulate
from pathlib import Path

from renderer.errors import InputError, require_package
from renderer.readers.dicom_fields import Dataset, Dimension, numbers_of, text_of, unreadable_slice
from renderer.scene import short_text

# Kinds of files that have rows and columns but no pixels.
_SPECTRA = ("MR Spectroscopy",)
# Kinds of files that hold tiles of a slide.
_SLIDES = ("VL Whole Slide Microscopy Image",)
# The modalities whose frames are times of one plane, unless the file gives a place for each frame; and a name for such
# a run.
_RUNS = {
    "XA": "an X-ray run",
    "RF": "an X-ray run",
    "DX": "an X-ray run",
    "CR": "an X-ray run",
    "RTIMAGE": "an X-ray run",
    "US": "an ultrasound clip",
    "IVUS": "an ultrasound clip",
    "ES": "a film of an endoscope",
    "XC": "a film of a camera",
    "GM": "a film of a microscope",
    "OP": "a film of an eye",
}
# Fields with the time from one frame to the next, where frames are times of one plane (PS3.3, C.7.6.5 and C.7.6.6).
_STEPS = ("FrameTimeVector", "FrameTime")
# The name of the dimension that distinguishes the frames of a run without times.
_NUMBERED = "frame number"
# The beginning of the UIDs of transfer syntaxes that compress by JPEG or as a film; a number follows.
_COMPRESSED = "1.2.840.10008.1.2.4."
# The first number behind _COMPRESSED that stands for a film: MPEG2, MPEG-4 or HEVC (PS3.5, A.4).
_FIRST_FILM = 100
# The last number behind _COMPRESSED that stands for a film.
_LAST_FILM = 108
# The transfer syntax of extended JPEG, which may have 12 bits a pixel.
_TWELVE_BITS = "1.2.840.10008.1.2.4.51"


def kind_of(dataset: Dataset) -> str:
    """Return the name of the kind of a DICOM file, such as `CT Image`; an empty text for an unknown kind."""
    from pydicom.uid import UID

    uid = UID(text_of([dataset], "SOPClassUID") or text_of([dataset.file_meta], "MediaStorageSOPClassUID"))
    return uid.name.removesuffix(" Storage") if uid.type == "SOP Class" else ""


def kind_without_pixels(dataset: Dataset) -> str:
    """Return the kind of a DICOM file if that kind never has pixels, such as `RT Plan`; else an empty text."""
    kind = kind_of(dataset)
    may_have_pixels = "Image" in kind or kind in ("Segmentation", "RT Dose", "Parametric Map") or "Rows" in dataset
    return "" if may_have_pixels and kind not in _SPECTRA else kind


def require_image(path: Path, dataset: Dataset, *, has_pixels: bool) -> None:
    """Raise InputError for files of a kind without pixels, for images that lack pixels, and for tiles of a slide."""
    kind = kind_without_pixels(dataset)
    if kind:
        hint = "name the images that it belongs to"
        if "Directory" in kind:
            hint = "an index of other files: name the folder that holds them"
        elif "Structure Set" in kind or "Surface" in kind:
            hint = "contours, not voxels: save them as a mask first, for example in 3D Slicer"
        raise _no_volume(path, f"{kind}, a kind of file without pixels", hint)
    count = text_of([dataset], "NumberOfFrames")
    is_slide = kind_of(dataset) in _SLIDES or "TotalPixelMatrixColumns" in dataset
    if is_slide and count not in ("", "1"):
        hint = "they are side by side in one picture: join them first, for example by `bfconvert` of Bio-Formats"
        raise _no_volume(path, f"{short_text(count)} tiles of a slide, which are no slices", hint)
    syntax = dataset.file_meta.get("TransferSyntaxUID")
    if not has_pixels and not (syntax is not None and syntax.is_deflated):
        elsewhere = "PixelDataProviderURL" in dataset
        got = "pixels in another place (PixelDataProviderURL)" if elsewhere else "no PixelData behind the header"
        hint = "it is a header alone, or was cut off: copy it again, or export it with its pixels"
        raise unreadable_slice(path, "download it with its pixels" if elsewhere else hint, got)


def _no_volume(path: Path, got: str, hint: str) -> InputError:
    expected = "an image, a dose or a segmentation"
    return InputError("this DICOM file holds no volume", where=str(path), got=got, expected=expected, hint=hint)


def compression_error(path: Path, dataset: Dataset) -> InputError | None:
    """Return the error for pixels in a compression that cannot be decoded; None for all other compressions."""
    syntax = text_of([dataset.file_meta], "TransferSyntaxUID")
    number = syntax.removeprefix(_COMPRESSED)
    if syntax.startswith(_COMPRESSED) and number[:3].isdecimal() and _FIRST_FILM <= int(number[:3]) <= _LAST_FILM:
        return _no_volume(path, f"a film ({_name_of(syntax)}), whose frames are no slices", "it holds no voxels")
    is_twelve = syntax == _TWELVE_BITS and numbers_of([dataset], "BitsStored") != [8.0]
    if not is_twelve and _is_decoded(syntax):
        return None
    got = _name_of(syntax) + " of 12 bits" * is_twelve
    hint = "decompress it first: `dcmdjpeg IN OUT` of DCMTK, or `gdcmconv --raw IN OUT` of GDCM"
    return InputError("pixels in this compression are not read", where=str(path), got=got, hint=hint)


def _name_of(syntax: str) -> str:
    from pydicom.uid import UID

    return short_text(UID(syntax).name)


def _is_decoded(syntax: str) -> bool:
    """Return whether the pixels of a transfer syntax can be decoded.

    A file without a preamble has an empty text for the syntax, and pixels that can be decoded. Raises InputError if a
    package with the decoder is not installed.
    """
    from pydicom.pixels.decoders.base import get_decoder
    from pydicom.uid import UID

    uid = UID(syntax)
    if not syntax or (uid.is_transfer_syntax and not uid.is_compressed):
        return True
    try:
        decoder = get_decoder(uid)
    except NotImplementedError:
        return False
    if not decoder.is_available and any("gdcm" in each for each in decoder.missing_dependencies):
        require_package("gdcm", extra="dicom")
    return bool(decoder.is_available)


def run_of(dataset: Dataset, count: int) -> tuple[Dimension, str] | None:
    """Return the dimension that distinguishes the frames of a run, and a note on the run; None for slices.

    The frames of a run are times of one plane. dataset: a file without positions of its frames. count: their number.
    """
    if count == 1 or "SliceVector" in dataset or any(numbers_of([dataset], "SpacingBetweenSlices")):
        return None
    pointers = _increments(dataset)
    step = next((each for each in _STEPS if each in dataset and (not pointers or each in pointers)), None)
    word = _RUNS.get(text_of([dataset], "Modality").strip())
    if step is None and (word is None or (pointers and not {*_STEPS} & {*pointers})):
        return None
    note = f"{count} frames of {word or 'a run'}: times of one plane, and no slices"
    return Dimension(step or _NUMBERED, "t"), note


def _increments(dataset: Dataset) -> list[str]:
    """Return the keywords of the fields that FrameIncrementPointer names: frames of the file differ in them."""
    from pydicom.datadict import keyword_for_tag

    value = dataset.get("FrameIncrementPointer")
    tags = [] if value is None else [value] if isinstance(value, int) else list(value)
    return [keyword_for_tag(tag) for tag in tags]


def times_of_run(dataset: Dataset, count: int) -> list[float]:
    """Return the times of the frames of a file of one plane, in ms after the first; an empty list without times."""
    vector, step = numbers_of([dataset], "FrameTimeVector"), numbers_of([dataset], "FrameTime")
    if len(vector) == count:  # the first number is 0, as no frame comes before
        return list(accumulate([0.0, *vector[1:]]))
    return [k * step[0] for k in range(count)] if step and step[0] > 0 else []
