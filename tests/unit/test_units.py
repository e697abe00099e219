"""Units of lengths and values, and axes of a body: those that a file states, and none where it states none."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import nrrd
import numpy as np
import pytest
from click.testing import CliRunner
from dicom_files import image_fields, save
from tiff_files import ome
from volume_files import NIBABEL, ramp, read, write_image, written

from hsplat_cli.commands.info import info
from renderer.errors import SceneError
from renderer.readers import mix_steps, read_volume
from renderer.scene import ProceduralSource, VolumeSpec, parse_scene
from renderer.volume import Volume, move_volume
from tests.unit.test_readers_hdf5 import save as save_hdf5
from tests.unit.test_readers_mrc import mrc
from tests.unit.test_readers_others import cube
from tests.unit.test_readers_tiff import tiff_bytes

VALUES = ramp("int16")
NOTHING = ("", "", "")
PLACE = {"ImagePositionPatient": ["0"] * 3, "ImageOrientationPatient": ["1", "0", "0", "0", "1", "0"]}
HOUNSFIELD = {"RescaleIntercept": "-1024", "RescaleSlope": "1"}
AS_STORED = {"RescaleIntercept": "0", "RescaleSlope": "1"}


def facts(volume: Volume) -> tuple[str, str, str]:
    return volume.length_unit, volume.world_axes, volume.value_unit


def nifti(unit: str, form: int = 1, kind: str = "Nifti1Image") -> Callable[[Path], None]:
    def write(path: Path) -> None:
        image = getattr(NIBABEL, kind)(VALUES.T, np.eye(4))
        if kind == "Nifti1Image":
            image.header.set_xyzt_units(unit)
            image.set_sform(np.eye(4), form), image.set_qform(np.eye(4), 0)
        image.to_filename(path)

    return write


def header_of_nrrd(**fields: Any) -> Callable[[Path], None]:
    return lambda path: nrrd.write(str(path), VALUES, {key.replace("_", " "): each for key, each in fields.items()})


def metaimage(*lines: str) -> Callable[[Path], None]:
    def write(path: Path) -> None:
        write_image(path, VALUES, direction=np.diag([-1.0, 1.0, -1.0]))
        written(path, "".join(f"{line}\n" for line in lines).encode() + path.read_bytes())

    return write


def dicom(dtype: str = "int16", **fields: Any) -> Callable[[Path], None]:
    return lambda path: save(path, image_fields(VALUES[0].astype(dtype), **fields))


def tiff(*args: Any, **options: Any) -> Callable[[Path], object]:
    return lambda path: written(path, tiff_bytes(VALUES, *args, **options))


EVEN = {axis: (np.arange(n), "nm") for axis, n in zip("zyx", VALUES.shape, strict=True)}
BODY = {"space": "left-posterior-superior", "space_directions": np.eye(3)}


@pytest.mark.usefixtures("one_process")
@pytest.mark.parametrize(
    ("name", "write", "expected"),
    [
        ("a.nii", nifti("mm"), ("mm", "LPS", "")),
        ("a.nii", nifti("micron"), ("µm", "LPS", "")),
        ("a.nii", nifti("unknown", 0), NOTHING),
        ("a.hdr", nifti("", kind="AnalyzeImage"), ("mm", "", "")),
        ("a.mgz", nifti("", kind="MGHImage"), ("mm", "LPS", "")),
        ("a.nrrd", header_of_nrrd(**BODY, space_units=["um"] * 3, sample_units="g/cm^3"), ("µm", "LPS", "g/cm^3")),
        ("a.nrrd", header_of_nrrd(space="scanner-xyz", space_directions=np.eye(3)), NOTHING),
        ("a.nrrd", header_of_nrrd(spacings=[1, 1, 2], units=["nm"] * 3), ("nm", "", "")),
        ("a.nrrd", header_of_nrrd(**BODY, space_units=["mm", "m", "s"], sample_units="13_characters"), ("", "LPS", "")),
        ("a.mha", metaimage("DistanceUnits = um", "AnatomicalOrientation = LAS"), ("µm", "LPS", "")),
        ("a.mha", metaimage("DistanceUnits = ?", "AnatomicalOrientation = RAI"), NOTHING),
        ("a.dcm", dicom(**PLACE, **HOUNSFIELD), ("mm", "LPS", "HU")),
        ("a.dcm", dicom(**PLACE, **HOUNSFIELD, RescaleType="US"), ("mm", "LPS", "")),
        ("a.dcm", dicom(**PLACE, **AS_STORED), ("mm", "LPS", "HU")),
        ("a.dcm", dicom("uint8", **PLACE, **AS_STORED), ("mm", "LPS", "")),
        ("a.dcm", dicom("uint8", **PLACE, **AS_STORED, RescaleType="HU"), ("mm", "LPS", "HU")),
        ("a.dcm", dicom(**PLACE, AnatomicalOrientationType="QUADRUPED"), ("mm", "", "")),
        ("a.dcm", dicom(Modality="PT", Units="BQML", RescaleIntercept="0"), ("mm", "", "BQML")),
        ("a.mrc", lambda path: written(path, mrc(VALUES, mode=1)), ("Å", "", "")),
        ("a.mrc", lambda path: written(path, mrc(VALUES, mode=1, cell=(0, 0, 0))), NOTHING),
        ("a.cube", lambda path: path.write_text(cube(VALUES / 8.0)), ("bohr", "", "")),
        ("a.tif", tiff(description="ImageJ=1.5\nimages=3\nunit=\\u00B5m\nspacing=2\n"), ("µm", "", "")),
        ("a.tif", tiff(description="ImageJ=1.5\nimages=3\nunit=pixel\nspacing=2\n"), NOTHING),
        ("a.tif", tiff(resolution=(3, (50, 1), (50, 1))), ("mm", "", "")),
        ("a.tif", tiff(resolution=(2, (72, 1), (72, 1))), NOTHING),
        ("a.tif", lambda path: written(path, ome('PhysicalSizeX="2" PhysicalSizeXUnit="nm"')), ("nm", "", "")),
        ("a.tif", lambda path: written(path, ome('PhysicalSizeX="2" PhysicalSizeXUnit="\x1b[1mm"')), NOTHING),
        ("a.h5", lambda path: save_hdf5(path, element_size_um=[1, 2, 3], units="K"), ("µm", "", "K")),
        ("a.h5", lambda path: save_hdf5(path, dims=EVEN, units="1"), ("nm", "", "")),
        ("a.npy", lambda path: np.save(path, VALUES), NOTHING),
    ],
)  # fmt: skip
def test_what_files_say(tmp_path, name: str, write: Callable[[Path], object], expected: tuple[str, str, str]) -> None:
    write(tmp_path / name)
    assert facts(read(tmp_path / name)) == expected


def test_a_scene_names_the_unit_of_its_lengths(tmp_path: Path) -> None:
    path = tmp_path / "a.nii"
    nifti("mm")(path)
    known, spacing = read(path), (0.1, 0.1, 0.5)
    assert facts(read(path, spacing)) == ("", "LPS", "")
    assert facts(read(path, (1.0, 1.0001, 1.0))) == ("mm", "LPS", "")
    assert facts(read(path, spacing, unit="microns")) == ("µm", "LPS", "")
    assert read(path, unit="m").fingerprint == known.fingerprint
    assert read_volume(VolumeSpec(ProceduralSource("constant", (2, 2, 2)), unit="km")).length_unit == "km"
    assert facts(mix_steps(known, known, 0.5)) == facts(known)
    c, s = np.cos(0.3), np.sin(0.3)
    turn = np.array([[c, -s, 0, 9], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    assert facts(move_volume(known, turn)) == facts(known)
    assert facts(move_volume(known, turn @ turn)) == ("mm", "", "")


@pytest.mark.parametrize("unit", ["", " ", "a unit too long", "\x1b[1m", 1, "12", "m\nm"])
def test_units_that_are_none(tmp_path: Path, unit: object) -> None:
    procedural = {"name": "constant", "shape": [2, 2, 2]}
    with pytest.raises(SceneError) as error:
        parse_scene({"version": 1, "volume": {"procedural": procedural, "unit": unit}}, base=tmp_path)
    assert "a unit such as mm or µm" in {each.path: each for each in error.value.problems}["volume.unit"].expected


def test_info_tells_units_that_come_out_of_the_child(tmp_path: Path) -> None:
    dicom(**PLACE, **HOUNSFIELD)(tmp_path / "a.dcm")
    text, data = (CliRunner().invoke(info, [str(tmp_path / "a.dcm"), *more]).stdout for more in ([], ["--json"]))
    assert "  spacing      0.5 x 0.25 x 1 mm\n" in text and " HU, mean " in text
    assert "  world axes   to the left, to the back and up in a body (LPS)\n" in text
    told = json.loads(data)
    assert [told[key] for key in ("length_unit", "world_axes", "value_unit")] == ["mm", "LPS", "HU"]
