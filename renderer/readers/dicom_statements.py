"""List the DICOM fields that change how voxels are understood, and find the fields of a file that are not applied."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from renderer.readers.dicom_fields import TOLD_APART, VECTORS, Dataset, numbers_of, text_of
from renderer.readers.statements import FormatTable, Statement

# The field that says that low values are shown light, together with its value, as a note names it.
MONOCHROME1 = "PhotometricInterpretation MONOCHROME1"
# The field with the frame of reference (the coordinates of positions), which a note names if frames differ in it.
OTHER_SPACE = "FrameOfReferenceUID"
# The field with the tilt of the gantry, which is needed only where slices have no positions.
_TILT = "GantryDetectorTilt"
# The field that says how the patient lies, which is needed only where slices have no directions.
_LIES = "PatientPosition"

_VALUES = (
    Statement("RescaleSlope", "values", "a factor on stored values"),
    Statement("RescaleIntercept", "values", "an offset of stored values"),
    Statement("ModalityLUTSequence", "values", "a table of values, in place of slope and intercept"),
    Statement("DoseGridScaling", "values", "a factor on stored doses"),
    Statement(
        "RealWorldValueMappingSequence",
        "values",
        "slope and intercept to a real unit, unless RescaleSlope and RescaleIntercept apply",
    ),
    Statement("MaximumFractionalValue", "values", "the stored value of a whole voxel of a segment"),
    Statement("PixelRepresentation", "values", "whether stored values have a sign"),
    Statement("BitsStored", "values", "the number of bits of a value"),
    Statement("RedPaletteColorLookupTableData", "values", "a palette of colours"),
)
_PLACE = (
    Statement("PixelSpacing", "place", "the distance of pixels, down and across"),
    Statement("ImagerPixelSpacing", "place", "the distance of pixels at the detector"),
    Statement("PixelAspectRatio", "place", "the height of a pixel by its width, without lengths"),
    Statement("SpacingBetweenSlices", "place", "the distance of slices, without positions"),
    Statement("SliceThickness", "place", "the distance of slices, without other fields"),
    Statement("ImagePositionPatient", "place", "the place of the first pixel"),
    Statement("ImageOrientationPatient", "place", "the directions of rows and columns"),
    Statement("ImagePositionVolume", "place", "the place of the first pixel, of ultrasound"),
    Statement("ImageOrientationVolume", "place", "the directions of rows and columns, of ultrasound"),
    Statement("PatientOrientation", "place", "the directions of rows and columns, by letters"),
    Statement("SliceLocation", "place", "the place of a slice, without a position"),
    Statement("InstanceNumber", "place", "the number of a slice, without SliceLocation"),
    Statement("InStackPositionNumber", "place", "the number of a frame, without a position"),
    Statement("SliceVector", "place", "the number of each frame, of nuclear medicine"),
    Statement("GridFrameOffsetVector", "place", "the place of each frame of a dose"),
    Statement(_TILT, "place", "an angle of the gantry, where slices have no positions", is_applied=False),
    Statement("EstimatedRadiographicMagnificationFactor", "place", "a magnification", is_applied=False),
    Statement("SequenceOfUltrasoundRegions", "place", "lengths in parts of the picture", is_applied=False),
    Statement("VolumetricProperties", "place", "a distorted or mixed image", is_applied=False),
    Statement(OTHER_SPACE, "place", "positions in different frames of reference", is_applied=False),
)
_VALIDITY = (
    Statement("PixelPaddingValue", "validity", "a stored value that stands for no data"),
    Statement("PixelPaddingRangeLimit", "validity", "the other end of a range of such values"),
    Statement("FloatPixelPaddingValue", "validity", "a floating-point value that stands for no data"),
    Statement("BurnedInAnnotation", "validity", "text burned into the image", is_applied=False),
)
_MEANING = (
    Statement("RescaleType", "meaning", "the unit of the values"),
    Statement("ModalityLUTType", "meaning", "the unit of the values of a table"),
    Statement("MeasurementUnitsCodeSequence", "meaning", "the unit of a real world value mapping"),
    Statement("Units", "meaning", "the unit of values of PET"),
    Statement("DoseUnits", "meaning", "the unit of a dose"),
    Statement("SegmentLabel", "meaning", "the name of a segment"),
    Statement("RecommendedDisplayCIELabValue", "meaning", "the colour of a segment"),
    Statement("AnatomicalOrientationType", "meaning", "axes of a quadruped, which are not LPS"),
    Statement("FrameTime", "meaning", "the time between frames of one plane"),
    Statement("FrameTimeVector", "meaning", "the time between frames of one plane"),
    *(
        Statement(keyword, "meaning", "a difference of times or components")
        for keyword in dict.fromkeys(
            word for each in (*TOLD_APART, *VECTORS) for word in each.name.split(" and ") if word != "InstanceNumber"
        )
    ),
    Statement(MONOCHROME1, "meaning", "a display of low values as light", is_applied=False),
    Statement("PresentationLUTShape", "meaning", "a display of low values as light", is_applied=False),
    Statement("PixelIntensityRelationship", "meaning", "values on a logarithmic scale", is_applied=False),
    Statement("RealWorldValueLUTData", "meaning", "a table of values in a real unit", is_applied=False),
    Statement("PixelPresentation", "meaning", "values that stand for colours", is_applied=False),
    Statement("OverlayData", "meaning", "graphics over the image", is_applied=False),
    Statement("VolumeBasedCalculationTechnique", "meaning", "a projection or another sum of voxels", is_applied=False),
    Statement(_LIES, "meaning", "the position of the patient, where slices have no directions", is_applied=False),
    Statement("DecayCorrection", "meaning", "values without decay correction", is_applied=False),
    Statement("SUVType", "meaning", "the divisor of the uptake", is_applied=False),
    Statement("DoseType", "meaning", "a dose that is not the physical one", is_applied=False),
    Statement("DoseSummationType", "meaning", "a dose other than the dose of a whole plan", is_applied=False),
)
STATEMENTS = FormatTable("DICOM", (*_VALUES, *_PLACE, *_VALIDITY, *_MEANING))

# The values with which each field that is not applied changes nothing, so that no note names it. A missing field
# changes nothing either.
_NEUTRAL = {
    "PresentationLUTShape": ("IDENTITY",),
    "PixelIntensityRelationship": ("LIN",),
    "PixelPresentation": ("MONOCHROME", "TRUE_COLOR"),
    "VolumetricProperties": ("VOLUME", "SAMPLED"),
    "VolumeBasedCalculationTechnique": ("NONE",),
    "BurnedInAnnotation": ("NO",),
    "DecayCorrection": ("START", "ADMIN"),
    "SUVType": ("BW",),
    "DoseType": ("PHYSICAL",),
    "DoseSummationType": ("PLAN", "MULTI_PLAN"),
    "EstimatedRadiographicMagnificationFactor": ("1", "1.0"),
}
# The group numbers of the fields of overlays: graphics over an image.
_OVERLAYS = range(0x6000, 0x6020, 2)
# The element number of the field with the rows of an overlay. Every overlay has this field.
_ROWS_OF_OVERLAY = 0x0010


def stated_in(fields: Sequence[Dataset], *, has_place: bool, has_axes: bool) -> frozenset[str]:
    """Return the names of the statements about a frame that are not applied.

    Statements are fields that change how voxels are understood. OTHER_SPACE is not among the names: several frames must
    be compared to find it.

    has_place, has_axes: whether the frame has a position, and directions.
    """
    texts = {keyword: text_of(fields, keyword).strip().upper() for keyword in _NEUTRAL}
    found = {keyword for keyword, text in texts.items() if text and text not in _NEUTRAL[keyword]}
    if any(each.get("SequenceOfUltrasoundRegions") for each in fields):
        found.add("SequenceOfUltrasoundRegions")
    if any("RealWorldValueLUTData" in each for each in fields):
        found.add("RealWorldValueLUTData")
    if text_of(fields, "PhotometricInterpretation").strip() == "MONOCHROME1":
        found.add(MONOCHROME1)
    if any(numbers_of(fields, _TILT)) and not has_place:
        found.add(_TILT)
    if text_of(fields, _LIES) and not has_axes:
        found.add(_LIES)
    if any((group, _ROWS_OF_OVERLAY) in each for each in fields for group in _OVERLAYS):
        found.add("OverlayData")
    return frozenset(found)


def note_on(found: Iterable[frozenset[str]], spaces: Iterable[str]) -> str | None:
    """Return the note on the statements that are not applied; None if there are none.

    found: the names that `stated_in` returns for each frame. spaces: the UID of the frame of reference of each frame;
    an empty text for an unknown one.
    """
    are_several = len({*spaces} - {""}) > 1
    return STATEMENTS.note(frozenset[str]().union(*found, {OTHER_SPACE} if are_several else ()))
