"""Samples of DICOM: files that pydicom writes, with and without each field that changes how voxels are understood."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from dicom_files import functional_groups, image_fields, save
from pydicom.datadict import dictionary_VR
from pydicom.dataset import Dataset
from statement_samples import Sample, Samples, Writer

_AXES = ["1", "0", "0", "0", "1", "0"]
_PLANE = np.arange(20, dtype=np.uint16).reshape(4, 5)
_FRAMES = np.broadcast_to(np.arange(4, dtype=np.uint16)[:, np.newaxis, np.newaxis], (4, 4, 5))
# Of MR, whose values have no unit unless the file says it, and which is no run.
_MR = {"Modality": "MR"}
_CLIP = {"Modality": "US", "PixelSpacing": None}
_PLACED = {"ImagePositionPatient": ["0", "0", "0"], "ImageOrientationPatient": _AXES}


def _item(**fields: Any) -> list[Dataset]:
    item = Dataset()
    for keyword, value in fields.items():
        setattr(item, keyword, value)
    return [item]


def _file(values: Any = _PLANE, **fields: Any) -> Writer:
    def write(folder: Path) -> Path:
        path = folder / "a.dcm"
        save(path, image_fields(values, **(_MR | fields)))
        return path

    return write


def _series(slices: Sequence[dict[str, Any]]) -> Writer:
    """Write slices in files of their own; their pixels are their number."""

    def write(folder: Path) -> Path:
        for k, fields in enumerate(slices):
            save(folder / f"{k}.dcm", image_fields(np.full_like(_PLANE, k), **(_MR | fields)))
        return folder

    return write


def _pair(common: dict[str, Any], plain: dict[str, Any], stated: dict[str, Any], values: Any = _PLANE) -> Sample:
    """Return a sample of files with common fields; each may have others, and `plain` may be neutral."""
    return Sample(_file(values, **(common | plain)), _file(values, **(common | stated)))


def _named(keyword: str, value: Any, neutral: Any = None, **common: Any) -> Sample:
    return _pair(common, {keyword: neutral}, {keyword: value})


def _table(kind: str = "US") -> list[Dataset]:
    (item,) = _item(ModalityLUTType=kind)
    item.add_new("LUTDescriptor", "US", [3, 1, 16])
    item.add_new("LUTData", "US", [7, 70, 700])
    return [item]


def _real(unit: str = "1") -> list[Dataset]:
    unit_code = _item(CodeValue=unit, CodingSchemeDesignator="UCUM", CodeMeaning="unit")
    return _item(RealWorldValueSlope=2.0, RealWorldValueIntercept=1.0, MeasurementUnitsCodeSequence=unit_code)


def _palette(*, has_red: bool) -> Writer:
    fields: dict[str, Any] = {"PhotometricInterpretation": "PALETTE COLOR"}
    for color in ("Red", "Green", "Blue"):
        fields[f"{color}PaletteColorLookupTableDescriptor"] = [20, 0, 8]
        if has_red or color != "Red":
            fields[f"{color}PaletteColorLookupTableData"] = bytes(range(100, 120))
    return _file(_PLANE.astype(np.uint8), **fields)


def _groups(keyword: str, value: Any) -> dict[str, Any]:
    """Return functional groups with a field in the content of each frame."""
    frames = [_item(FrameContentSequence=_item(**({keyword: k + 1} | value(k))))[0] for k in range(len(_FRAMES))]
    return {"PerFrameFunctionalGroupsSequence": frames, "SpacingBetweenSlices": "1"}


def segmentation(kind: str, values: Any, **fields: Any) -> Dataset:
    """Return a segmentation of two segments, whose frames [segment, y, x] lie side by side."""
    dataset = functional_groups(values.astype(np.int64) - 1000, [0, 0], spacing=0.0)
    dataset.SharedFunctionalGroupsSequence[0].PixelValueTransformationSequence[0].RescaleIntercept = "0"
    for number, frame in enumerate(dataset.PerFrameFunctionalGroupsSequence, start=1):
        frame.SegmentIdentificationSequence = _item(ReferencedSegmentNumber=number)
    dataset.PixelData = values.astype(np.uint8).tobytes()
    dataset.BitsAllocated, dataset.BitsStored, dataset.HighBit = 8, 8, 7
    dataset.SegmentationType = kind
    dataset.SegmentSequence = [_item(SegmentNumber=1, **fields)[0], _item(SegmentNumber=2)[0]]
    return dataset


def _segments(maximum: int | None = None, **fields: Any) -> Writer:
    def write(folder: Path) -> Path:
        values = np.stack([_PLANE % 5, _PLANE // 5]) if maximum else np.stack([_PLANE < 5, _PLANE > 12])
        dataset = segmentation("FRACTIONAL" if maximum else "BINARY", values, **fields)
        if maximum:
            dataset.MaximumFractionalValue = maximum
        save(folder / "a.dcm", dataset)
        return folder / "a.dcm"

    return write


def _overlay(*, has_one: bool) -> Writer:
    def write(folder: Path) -> Path:
        dataset = image_fields(_PLANE, **_MR)
        if has_one:
            dataset.add_new(0x60000010, "US", 4)
            dataset.add_new(0x60000011, "US", 5)
            dataset.add_new(0x60003000, "OW", b"\1\0\0\0")
        save(folder / "a.dcm", dataset)
        return folder / "a.dcm"

    return write


def _floats(padding: float | None) -> Writer:
    of_integers = dict.fromkeys(("PixelData", "BitsStored", "HighBit", "PixelRepresentation"))
    values = _PLANE.astype(np.float32)
    return _file(values, **(of_integers | {"FloatPixelData": values.tobytes(), "FloatPixelPaddingValue": padding}))


_SAMPLE_VALUES = {
    "DT": ["20200101120000", "20200101120001"],
    "TM": ["120000", "120001"],
    "CS": ["ONE", "TWO"],
    "SH": ["1", "2"],
}


def _told_apart(keyword: str) -> Sample:
    """Return a series of two places and two slices at each, told apart by their numbers, or by a field."""
    plain = [
        {"ImagePositionPatient": ["0", "0", str(k % 2)], "ImageOrientationPatient": _AXES, "InstanceNumber": str(k + 1)}
        for k in range(4)
    ]
    own = _SAMPLE_VALUES.get(dictionary_VR(keyword), [1, 2])
    if keyword == "DiffusionGradientOrientation":
        own = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]
    stated = [fields | {keyword: own[k // 2]} for k, fields in enumerate(plain)]
    return Sample(_series(plain), _series(stated))


def _vector(keyword: str) -> Sample:
    common = {"SliceVector": [1, 2, 1, 2], "SpacingBetweenSlices": "1"}
    return _pair(common, {}, {keyword: [1, 1, 2, 2]}, _FRAMES)


_NUMBERED: list[dict[str, Any]] = [{"InstanceNumber": str(k + 1), "SliceThickness": "1"} for k in range(3)]
_SPACES = [_PLACED | {"ImagePositionPatient": ["0", "0", str(k)]} for k in range(2)]

# Fields that tell the frames of a file apart.
_DIMENSIONS = (
    "StackID",
    "ReferencedSegmentNumber",
    "TemporalPositionIdentifier",
    "TemporalPositionIndex",
    "EchoNumbers",
    "EffectiveEchoTime",
    "EchoTime",
    "DiffusionBValue",
    "DiffusionGradientOrientation",
    "InversionTime",
    "NominalPercentageOfCardiacPhase",
    "NominalCardiacTriggerDelayTime",
    "TemporalPositionTimeOffset",
    "TriggerTime",
    "FrameReferenceTime",
    "ComplexImageComponent",
    "FrameType",
    "ImageType",
    "FrameAcquisitionNumber",
    "AcquisitionNumber",
    "FrameAcquisitionDateTime",
    "AcquisitionDateTime",
    "AcquisitionTime",
    "ContentTime",
)
# Fields that have a number for each frame.
_VECTORS = (
    "EnergyWindowVector",
    "DetectorVector",
    "PhaseVector",
    "RotationVector",
    "RRIntervalVector",
    "TimeSlotVector",
    "AngularViewVector",
    "TimeSliceVector",
)

SAMPLES: Samples = {
    "DICOM": {
        "RescaleSlope": _named("RescaleSlope", "2", "1"),
        "RescaleIntercept": _named("RescaleIntercept", "5", "0"),
        "ModalityLUTSequence": _named("ModalityLUTSequence", _table()),
        "DoseGridScaling": _named("DoseGridScaling", "0.5"),
        "RealWorldValueMappingSequence": _named("RealWorldValueMappingSequence", _real()),
        "MaximumFractionalValue": Sample(_segments(200), _segments(8)),
        "PixelRepresentation": _pair({}, {}, {"PixelRepresentation": 1}, _PLANE + np.uint16(40_000)),
        "BitsStored": _pair({}, {}, {"BitsStored": 12, "HighBit": 11}, _PLANE + np.uint16(40_000)),
        "RedPaletteColorLookupTableData": Sample(_palette(has_red=False), _palette(has_red=True)),
        "PixelSpacing": _named("PixelSpacing", ["1", "2"], ["1", "1"]),
        "ImagerPixelSpacing": _pair(_CLIP, {}, {"ImagerPixelSpacing": ["1", "2"]}, _FRAMES),
        "PixelAspectRatio": _pair(_CLIP, {}, {"PixelAspectRatio": ["2", "1"]}, _FRAMES),
        "SpacingBetweenSlices": _pair({}, {"SpacingBetweenSlices": "1"}, {"SpacingBetweenSlices": "2"}, _FRAMES),
        "SliceThickness": _pair({}, {"SliceThickness": "1"}, {"SliceThickness": "2"}, _FRAMES),
        "ImagePositionPatient": _pair(_PLACED, {}, {"ImagePositionPatient": ["1", "2", "3"]}),
        "ImageOrientationPatient": _pair(_PLACED, {}, {"ImageOrientationPatient": ["0", "1", "0", "0", "0", "-1"]}),
        "ImagePositionVolume": _named("ImagePositionVolume", [1.0, 2.0, 3.0]),
        "ImageOrientationVolume": _named("ImageOrientationVolume", [0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        "PatientOrientation": _named("PatientOrientation", ["P", "F"]),
        "SliceLocation": Sample(
            _series(_NUMBERED), _series([each | {"SliceLocation": f"{-5 * k}"} for k, each in enumerate(_NUMBERED)])
        ),
        "InstanceNumber": Sample(
            _series(_NUMBERED), _series([each | {"InstanceNumber": f"{9 - k}"} for k, each in enumerate(_NUMBERED)])
        ),
        "InStackPositionNumber": _pair(
            {},
            _groups("FrameReferenceTime", lambda _: {}),
            _groups("FrameReferenceTime", lambda k: {"InStackPositionNumber": 4 - k}),
            _FRAMES,
        ),
        "SliceVector": _pair({"SpacingBetweenSlices": "1"}, {}, {"SliceVector": [4, 3, 2, 1]}, _FRAMES),
        "GridFrameOffsetVector": _pair(
            {"SpacingBetweenSlices": "1"}, {}, {"GridFrameOffsetVector": ["0", "-2", "-4", "-6"]}, _FRAMES
        ),
        "GantryDetectorTilt": Sample(
            _series(_NUMBERED), _series([each | {"GantryDetectorTilt": "15"} for each in _NUMBERED])
        ),
        "EstimatedRadiographicMagnificationFactor": _named("EstimatedRadiographicMagnificationFactor", "1.5", "1"),
        "SequenceOfUltrasoundRegions": _named("SequenceOfUltrasoundRegions", _item(PhysicalDeltaX=0.1)),
        "VolumetricProperties": _named("VolumetricProperties", "DISTORTED", "VOLUME"),
        "FrameOfReferenceUID": Sample(
            _series([each | {"FrameOfReferenceUID": "1.2"} for each in _SPACES]),
            _series([each | {"FrameOfReferenceUID": f"1.{k}"} for k, each in enumerate(_SPACES)]),
        ),
        "PixelPaddingValue": _named("PixelPaddingValue", 3),
        "PixelPaddingRangeLimit": _named("PixelPaddingRangeLimit", 5, PixelPaddingValue=3),
        "FloatPixelPaddingValue": Sample(_floats(None), _floats(3.0)),
        "BurnedInAnnotation": _named("BurnedInAnnotation", "YES", "NO"),
        "RescaleType": _named("RescaleType", "OD", "US", RescaleSlope="2"),
        "ModalityLUTType": _pair({}, {"ModalityLUTSequence": _table()}, {"ModalityLUTSequence": _table("OD")}),
        "MeasurementUnitsCodeSequence": _pair(
            {}, {"RealWorldValueMappingSequence": _real()}, {"RealWorldValueMappingSequence": _real("mm2/s")}
        ),
        "Units": _named("Units", "BQML", "NONE"),
        "DoseUnits": _named("DoseUnits", "GY", "RELATIVE"),
        "SegmentLabel": Sample(_segments(), _segments(SegmentLabel="Liver")),
        "RecommendedDisplayCIELabValue": Sample(
            _segments(), _segments(RecommendedDisplayCIELabValue=[40_000, 50_000, 40_000])
        ),
        "AnatomicalOrientationType": _named("AnatomicalOrientationType", "QUADRUPED", "BIPED", **_PLACED),
        "FrameTime": _pair(_CLIP, {}, {"FrameTime": "33"}, _FRAMES),
        "FrameTimeVector": _pair(_CLIP, {}, {"FrameTimeVector": ["0", "33", "34", "35"]}, _FRAMES),
        **{keyword: _told_apart(keyword) for keyword in _DIMENSIONS},
        **{keyword: _vector(keyword) for keyword in _VECTORS},
        "PhotometricInterpretation MONOCHROME1": _named("PhotometricInterpretation", "MONOCHROME1", "MONOCHROME2"),
        "PresentationLUTShape": _named("PresentationLUTShape", "INVERSE", "IDENTITY"),
        "PixelIntensityRelationship": _named("PixelIntensityRelationship", "LOG", "LIN"),
        "RealWorldValueLUTData": _named("RealWorldValueMappingSequence", _item(RealWorldValueLUTData=[1.0, 4.0])),
        "PixelPresentation": _named("PixelPresentation", "MIXED", "MONOCHROME"),
        "OverlayData": Sample(_overlay(has_one=False), _overlay(has_one=True)),
        "VolumeBasedCalculationTechnique": _named("VolumeBasedCalculationTechnique", "MAX_IP", "NONE"),
        "PatientPosition": _named("PatientPosition", "FFS"),
        "DecayCorrection": _named("DecayCorrection", "NONE", "START"),
        "SUVType": _named("SUVType", "LBM", "BW"),
        "DoseType": _named("DoseType", "ERROR", "PHYSICAL"),
        "DoseSummationType": _named("DoseSummationType", "BEAM", "PLAN"),
    }
}
