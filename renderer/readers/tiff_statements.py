"""Read the fields of a TIFF page that change the meaning of its pixels, such as its orientation and its samples.

A note names the fields that are known but not applied.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from renderer.readers.orientation import known_orientation
from renderer.readers.statements import FormatTable, Statement
from renderer.readers.tiff_description import Page

STATEMENTS = FormatTable(
    "TIFF",
    (
        Statement("SampleFormat", "values", "integers with or without a sign, or floats"),
        Statement("Orientation", "place", "the sides of the first row and the first column"),
        Statement("XResolution", "place", "pixels per unit of length; also YResolution"),
        Statement("ResolutionUnit", "place", "the unit of the resolution"),
        Statement("ModelPixelScaleTag", "place", "the size of pixels on a map"),
        Statement("GDAL_NODATA", "validity", "the value that stands for no data"),
        Statement("ExtraSamples", "meaning", "whether a sample is alpha"),
        Statement("PhotometricInterpretation", "meaning", "white at 0, or colours other than red, green and blue",
                  is_applied=False),
        Statement("ColorMap", "meaning", "the colours of values", is_applied=False),
        Statement("AssociatedAlpha", "meaning", "colours that are multiplied by alpha", is_applied=False),
        Statement("GrayResponseCurve", "meaning", "the optical density of values", is_applied=False),
        Statement("XPosition", "place", "the place of the page; also YPosition", is_applied=False),
        Statement("ModelTiepointTag", "place", "the place of the page on a map", is_applied=False),
        Statement("ModelTransformationTag", "place", "the place of the page on a map", is_applied=False),
        Statement("GDAL_METADATA", "values", "a scale and an offset of values", is_applied=False),
        Statement("CZ_SEM", "place", "a record of the microscope", is_applied=False),
        Statement("FEI_SFEG", "place", "a record of the microscope", is_applied=False),
        Statement("FEI_HELIOS", "place", "a record of the microscope", is_applied=False),
        Statement("OlympusSIS", "place", "a record of the microscope", is_applied=False),
        Statement("MicroManagerMetadata", "place", "a record of the microscope", is_applied=False),
        Statement("UIC1tag", "place", "a record of the microscope", is_applied=False),
        Statement("TVIPS", "place", "a record of the microscope", is_applied=False),
    ),
)  # fmt: skip

# The number of the field Orientation.
_ORIENTATION = 274
# The number of the field GDAL_METADATA: XML, perhaps with a scale and an offset.
_GDAL_METADATA = 42112
# The fields that a note names if they are present, by their numbers in TIFF.
_NAMED = {291: "GrayResponseCurve", 33922: "ModelTiepointTag", 34264: "ModelTransformationTag"}
# The numbers of XPosition and YPosition, which a note names if they are not 0.
_POSITIONS = (286, 287)
# The fields with records of microscopes, by their numbers in TIFF. A note names them if nothing else gives lengths.
_RECORDS = {34118: "CZ_SEM", 34680: "FEI_SFEG", 34682: "FEI_HELIOS", 33560: "OlympusSIS"}
_RECORDS |= {51123: "MicroManagerMetadata", 33628: "UIC1tag", 37706: "TVIPS"}

# The number in PhotometricInterpretation for grey values whose 0 is white.
_WHITE_IS_0 = 0
# The number in PhotometricInterpretation for grey values whose 0 is black.
_BLACK_IS_0 = 1
# The number in PhotometricInterpretation for red, green and blue.
_RGB = 2
# The number in PhotometricInterpretation for indices into a palette.
_PALETTE = 3
# The number in PhotometricInterpretation for YCbCr: luminance and two differences of colours.
_YCBCR = 6
# The numbers in Compression for JPEG, whose pixels are decoded to red, green and blue.
_JPEGS = (6, 7)
# The code in ExtraSamples for associated alpha: colours are premultiplied by it.
_ASSOCIATED = 1
# The code in ExtraSamples for unassociated alpha: colours are not premultiplied by it.
_UNASSOCIATED = 2


def orientation(page: Page) -> int:
    """Return the orientation of a page, 1 if it has none."""
    return known_orientation(page.tags.valueof(_ORIENTATION))


def stated_orientations(pages: Sequence[Page]) -> set[int]:
    """Return the different orientations that pages state."""
    return {orientation(page) for page in pages if _ORIENTATION in page.tags}


def has_rgb(page: Page) -> bool:
    """Return whether the first three decoded samples are red, green and blue."""
    is_decoded = page.photometric == _YCBCR and page.compression in _JPEGS
    return bool(page.samplesperpixel >= 3 and (page.photometric == _RGB or is_decoded))


def sample_names(page: Page) -> list[str]:
    """Return the names of the samples of a page; an empty list unless it has colours or alpha."""
    count = page.samplesperpixel
    is_grey = page.photometric in (_WHITE_IS_0, _BLACK_IS_0) and _alpha_of(page) is not None
    if not has_rgb(page) and not (is_grey and count == 2):
        return []
    names = ["R", "G", "B"] if has_rgb(page) else ["grey"]
    extra = [*page.extrasamples, *[_UNASSOCIATED] * count][: count - len(names)]
    return [*names, *("A" if each in (_ASSOCIATED, _UNASSOCIATED) else "extra" for each in extra)]


def _alpha_of(page: Page) -> int | None:
    """Return the kind of alpha of a page, _ASSOCIATED or _UNASSOCIATED; None if it has no alpha."""
    return next((int(each) for each in page.extrasamples if each in (_ASSOCIATED, _UNASSOCIATED)), None)


def note_of(page: Page) -> str | None:
    """Return the note on the fields of a page that change what pixels mean, but are not applied; None without any."""
    return STATEMENTS.note(set(_unapplied(page)))


def records_of(page: Page) -> list[str]:
    """Return the names of a page's records of microscopes, which may hold lengths."""
    return [name for number, name in _RECORDS.items() if number in page.tags]


def _unapplied(page: Page) -> Iterator[str]:
    if page.photometric == _PALETTE:
        yield "ColorMap"
    elif page.photometric != _BLACK_IS_0 and not has_rgb(page):
        yield "PhotometricInterpretation"
    if _alpha_of(page) == _ASSOCIATED and has_rgb(page):
        yield "AssociatedAlpha"
    yield from (name for number, name in _NAMED.items() if number in page.tags)
    if any(np.ravel(page.tags.valueof(number) or 0)[0] for number in _POSITIONS):
        yield "XPosition"
    metadata = str(page.tags.valueof(_GDAL_METADATA) or "")
    if any(f'role="{role}"' in metadata for role in ("scale", "offset")):
        yield "GDAL_METADATA"
