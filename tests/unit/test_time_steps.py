"""Volumes in time: which files of a scene are its steps, what is read at a time, and when steps are."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tifffile
import yaml
from click.testing import CliRunner
from dicom_files import image_fields
from volume_files import NIBABEL, read, written

from hsplat_cli.commands.info import info
from hsplat_cli.commands.init import init
from renderer.errors import InputError, SceneError
from renderer.job import scene_files
from renderer.readers import read_volume
from renderer.scene import FileSource, Scene, VolumeSpec, parse_scene, scene_to_dict
from renderer.volume import Array

RAMP = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)
OTHERS: dict[str, Any] = {
    "transfer_function": {"colormap": "gray", "range": [0, 1], "opacity": [[0, 0], [1, 1]]},
    "camera": {"path": {"type": "turntable", "frames": 10}},
    "output": {"file": "film.mp4"},
}


def scene_of(folder: Path, file: object, **volume: object) -> Scene:
    return parse_scene(OTHERS | {"volume": {"file": file, **volume}}, base=folder)


def spec_of(folder: Path, file: object, **volume: object) -> VolumeSpec:
    return scene_of(folder, file, **volume).layers[0].volume


def source_of(folder: Path, file: object) -> FileSource:
    source = spec_of(folder, file).source
    assert isinstance(source, FileSource)
    return source


def problem_of(folder: Path, file: object, **volume: object) -> Any:
    with pytest.raises(SceneError) as error:
        scene_of(folder, file, **volume)
    (problem,) = error.value.problems
    return problem


def save(folder: Path, *names: str) -> None:
    """Write volumes whose voxels are larger by 10 in each."""
    for number, name in enumerate(names):
        np.save(folder / name, RAMP + np.uint8(10 * number))


def names_of(source: FileSource) -> list[str]:
    return [file.name for file in source.steps]


# Which files are steps


@pytest.mark.parametrize(
    ("pattern", "names"),
    [
        ("a_{}.npy", ["a_8.npy", "a_9.npy", "a_10.npy"]),
        ("a_{:02}.npy", ["a_08.npy", "a_09.npy", "a_10.npy"]),
        ("a_{:2}.npy", ["a_99.npy", "a_100.npy"]),
        ("{:04}_b.npy", ["0000_b.npy", "0100_b.npy", "0200_b.npy"]),
        ("a_{}.npy", ["a_7.npy"]),
    ],
)
def test_a_pattern_stands_for_files_in_the_order_of_their_numbers(tmp_path, pattern: str, names: list[str]) -> None:
    save(tmp_path, *names, "a_x.npy", "ab_1.npy", "a_1.npy.bak")
    source = source_of(tmp_path, pattern)
    assert names_of(source) == names
    assert source.file == tmp_path / names[0] == source.steps[0]
    plain = scene_to_dict(scene_of(tmp_path, pattern))
    assert plain["volume"]["file"] == [str(tmp_path / name) for name in names]
    assert parse_scene(plain, base=Path()) == scene_of(tmp_path, pattern)


def test_a_file_whose_name_is_a_pattern_is_itself(tmp_path: Path) -> None:
    save(tmp_path, "a_{}.npy", "a_1.npy")
    assert source_of(tmp_path, "a_{}.npy") == FileSource(tmp_path / "a_{}.npy")


def test_folders_may_be_steps(tmp_path: Path) -> None:
    for number in range(2):
        (tmp_path / f"phase_{number}").mkdir()
        save(tmp_path / f"phase_{number}", "a.npy")
    assert read_volume(spec_of(tmp_path, "phase_{}", time=1)).values.tolist() == RAMP.tolist()


@pytest.mark.parametrize(
    ("names", "what"),
    [
        ([f"a_{k}.npy" for k in range(30) if k != 17], "no step 17 of 0 to 29"),
        (["a_1.npy", "a_2.npy", "a_5.npy"], "no steps 3, 4 of 1 to 5"),
        (["a_0.npy", "a_1.npy", f"a_{10**17}.npy"], f"no steps 2, 3, 4 and {10**17 - 5} more of 0 to {10**17}"),
        (["a_0.npy", "a_100.npy", "a_300.npy"], "no step 200 of 0 to 300"),
        (["a_1.npy", "a_01.npy"], "two files of one step"),
        (["b.npy"], "no file matches this pattern"),
    ],
)
def test_patterns_that_are_not_whole_are_refused(tmp_path: Path, names: list[str], what: str) -> None:
    for name in names:
        (tmp_path / name).touch()
    problem = problem_of(tmp_path, "a_{}.npy")
    assert (problem.path, problem.what) == ("volume.file", what)


def test_wrong_lists_and_patterns_are_located(tmp_path: Path) -> None:
    save(tmp_path, "a.npy")
    missing = problem_of(tmp_path, ["a.npy", "b.npy", "c.npy"])
    assert (missing.path, missing.what, missing.hint) == ("volume.file.1", "no such file", "did you mean a.npy?")
    assert problem_of(tmp_path, []).what == "wrong number of steps"
    assert problem_of(tmp_path, ["a.npy"] * 10_001).expected == "1 to 10000 files"
    assert problem_of(tmp_path, "{}_{}.npy").what == "several fields in a pattern"
    assert problem_of(tmp_path, "{}/a.npy").what == "no such file"
    assert "a digit or more" in problem_of(tmp_path, "b_{}.npy").hint
    assert "4 digits or more" in problem_of(tmp_path, "b_{:04}.npy").hint


def test_a_folder_of_numbered_volumes_is_steps(tmp_path: Path) -> None:
    save(tmp_path, "b2.npy", "b10.npy", "b6.npy")
    (tmp_path / "read_me.txt").touch()
    assert names_of(source_of(tmp_path.parent, tmp_path.name)) == ["b2.npy", "b6.npy", "b10.npy"]


@pytest.mark.parametrize(
    "names",
    [
        ["b1.npy", "b2.npy"], ["b1.npy", "b2.npy", "b3.npy", "mask.npy"], ["b1.npy", "b2.npy", "b3.nrrd"],
        ["b1_1.npy", "b1_2.npy", "b2_1.npy"], ["b1.npy", "b2.npy", "b3.npy", "1.tif"],
        ["b1.npy", "b2.npy", "b3.npy", "IM0001"], ["b1.npy", "b2.npy", "b3.npy", "1.2.840.1"],
        ["1.png", "2.png", "3.png"],
    ],
)  # fmt: skip
def test_other_folders_are_as_they_were(tmp_path: Path, names: list[str]) -> None:
    for name in names:
        (tmp_path / name).touch()
    assert source_of(tmp_path, ".") == FileSource(tmp_path)


def collection(*elements: str) -> bytes:
    return f"<VTKFile type='Collection'><Collection>{''.join(elements)}</Collection></VTKFile>".encode()


def step(time: float, file: str) -> str:
    return f'<DataSet timestep="{time}" part="0" file="{file}"/>'


def test_a_collection_of_paraview(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    save(tmp_path / "in", "b.npy", "a.npy")
    written(tmp_path / "all.pvd", collection(step(0.5, "in/a.npy"), step(-1.5, "in/b.npy")))
    spec = spec_of(tmp_path, "all.pvd", time=1)
    assert isinstance(spec.source, FileSource)
    assert names_of(spec.source) == ["b.npy", "a.npy"]
    volume = read_volume(spec)
    assert (volume.num_times, volume.times, volume.time_unit) == (2, (-1.5, 0.5), "")
    assert volume.values.tolist() == (RAMP + 10).tolist()
    assert scene_to_dict(scene_of(tmp_path, "all.pvd"))["volume"]["file"] == str(tmp_path / "all.pvd")
    files = {file.name for file in scene_files(scene_of(tmp_path, "all.pvd"))}
    assert files == {"all.pvd", "a.npy", "b.npy"}


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (collection(), "wrong number of steps"), (collection(step(0, "../a.npy")), "a step outside of its folder"),
        (collection(step(0, "/etc/hostname")), "a step outside of its folder"),
        (collection(step(0, "")), "not a file name"), (collection(step(0, "b.npy")), "no such file"),
        (collection(step(0, "a.npy"), step(0, "a.npy")), "two files of one step"),
        (collection(step(0, "a.npy")).replace(b'"0"', b'"soon"', 1), "timestep: not such a number"),
        (b"<!DOCTYPE a [<!ENTITY b 'c'>]>" + collection(), "has a document type"), (b"<VTKFile>", "not valid XML"),
        (b"\xff", "not a text file in UTF-8"), (b" " * (2**22 + 1), "too large for a collection of ParaView"),
    ],
)  # fmt: skip
def test_wrong_collections_are_refused(tmp_path: Path, content: bytes, what: str) -> None:
    save(tmp_path, "a.npy")
    written(tmp_path / "all.pvd", content)
    problem = problem_of(tmp_path, "all.pvd")
    assert problem.path == "volume.file" and what in problem.what


# The time of a scene


def test_the_time_is_whole_or_a_float_between_steps(tmp_path: Path) -> None:
    save(tmp_path, "a_0.npy", "a_1.npy", "a_2.npy")
    assert [spec_of(tmp_path, "a_{}.npy", time=time).time for time in (1, "1", 2.0, "auto")] == [1, 1, 2, "auto"]
    assert type(spec_of(tmp_path, "a_{}.npy", time=1.0).time) is int
    assert type(spec_of(tmp_path, "a_{}.npy", time=1, interpolate=True).time) is float
    problem = problem_of(tmp_path, "a_{}.npy", time=0.5)
    assert (problem.path, problem.what) == ("volume.time", "not a whole number")
    assert problem_of(tmp_path, "a_{}.npy", time={0: 0, 9: 1.5}).what == "not a whole number"
    assert problem_of(tmp_path, "a_{}.npy", time=-1).what == "out of range"


def test_the_time_moves_in_steps_or_between_them(tmp_path: Path) -> None:
    save(tmp_path, "a_0.npy", "a_1.npy", "a_2.npy")
    by_frame = {0: 0, 5: 1, 9: 2}
    moved = scene_of(tmp_path, "a_{}.npy", time=by_frame)
    assert [moved.at(frame).layers[0].volume.time for frame in range(10)] == [0, 0, 0, 1, 1, 1, 1, 2, 2, 2]
    mixed = scene_of(tmp_path, "a_{}.npy", time=by_frame, interpolate=True)
    assert [mixed.at(frame).layers[0].volume.time for frame in (0, 1, 5, 7)] == [0.0, 0.2, 1.0, 1.5]
    for scene in (moved, mixed):
        assert scene.map(lambda each: each.layers[0].volume.time).moves
        assert parse_scene(json.loads(json.dumps(scene_to_dict(scene))), base=Path()) == scene


def test_labels_and_other_sources_have_nothing_between_steps(tmp_path: Path) -> None:
    save(tmp_path, "a_0.npy")
    file = {"file": "a_{}.npy", "interpolate": True}
    labels = {"volume": file, "labels": {"colors": {1: "red"}}, "camera": OTHERS["camera"], "output": OTHERS["output"]}
    masked = OTHERS | {"volume": {"file": "a_{}.npy"}, "mask": file}
    procedural = {"name": "atlas", "shape": [9, 9, 9]}
    made = OTHERS | {"volume": {"procedural": procedural, "interpolate": True}}
    for tree, path in ((labels, "labels"), (masked, "mask.interpolate"), (made, "volume.interpolate")):
        with pytest.raises(SceneError) as error:
            parse_scene(tree, base=tmp_path)
        assert [problem.path for problem in error.value.problems] == [path]


# What is read


def test_each_file_is_read_at_its_time(tmp_path: Path) -> None:
    save(tmp_path, "a_0.npy", "a_1.npy", "a_2.npy")
    for time in range(3):
        volume = read_volume(spec_of(tmp_path, "a_{}.npy", time=time))
        assert volume.values.dtype == np.uint8 and volume.num_times == 3 and volume.note is None
        np.testing.assert_array_equal(volume.values, RAMP + 10 * time)
        assert volume.name == str(tmp_path / f"a_{time}.npy")
    first = read_volume(spec_of(tmp_path, "a_{}.npy"))
    assert first.note == "3 times; the first is drawn; `time: k` chooses another"
    assert read_volume(spec_of(tmp_path, "a_{}.npy", time="auto")).fingerprint == first.fingerprint
    with pytest.raises(InputError, match="there is no such time step") as error:
        read_volume(spec_of(tmp_path, "a_{}.npy", time=3))
    assert error.value.expected == "0 to 2"
    assert read_volume(spec_of(tmp_path, "a_{}.npy", time="auto")).num_times == 3


def test_two_steps_are_mixed_in_their_scalars(tmp_path: Path) -> None:
    save(tmp_path, "a_0.npy", "a_1.npy")
    volume = read_volume(spec_of(tmp_path, "a_{}.npy", time=0.25, interpolate=True))
    assert volume.values.dtype == np.float32
    np.testing.assert_array_equal(volume.values, RAMP + np.float32(2.5))
    crop = ((1, 3), None, None)
    spec = VolumeSpec(FileSource(tmp_path / "b.npy"), 1.5, crop=crop, interpolate=True)
    np.save(tmp_path / "b.npy", np.stack([RAMP, RAMP + 10, RAMP + 30]))
    np.testing.assert_array_equal(read_volume(spec).values, RAMP[:, :, 1:3] + np.float32(20))
    assert read_volume(spec).num_times == 3
    with pytest.raises(InputError, match="there is no such time step"):
        read_volume(VolumeSpec(FileSource(tmp_path / "b.npy"), 2.5, interpolate=True))


def test_what_is_absent_in_a_step_is_absent_between_them(tmp_path: Path) -> None:
    before, after = RAMP.astype(np.float32), RAMP.astype(np.float32)
    before[0, 0, 1], after[1, 2, 3] = np.nan, -9999.0
    np.save(tmp_path / "a_0.npy", before)
    np.save(tmp_path / "a_1.npy", after)
    volume = read_volume(spec_of(tmp_path, "a_{}.npy", time=0.5, interpolate=True, nodata=[-9999]))
    assert volume.num_absent == 2 == np.isnan(volume.values).sum()
    assert np.isnan(volume.values[0, 0, 1]) and np.isnan(volume.values[1, 2, 3])
    assert volume.value_range() == (0.0, 22.0)


def test_colours_are_mixed(tmp_path: Path) -> None:
    for number in range(2):
        np.save(tmp_path / f"a_{number}.npy", np.full((2, 3, 4, 3), 100 * number, np.uint8))
    volume = read_volume(spec_of(tmp_path, "a_{}.npy", time=0.5, interpolate=True, component="color"))
    assert volume.colors is not None
    assert np.unique(volume.colors).tolist() == [50] and np.unique(volume.values).tolist() == [50.0]


def test_values_that_cannot_be_mixed(tmp_path: Path) -> None:
    np.save(tmp_path / "a_0.npy", np.full((2, 3, 4), 1e300))
    np.save(tmp_path / "a_1.npy", np.ones((2, 3, 4)))
    with pytest.raises(InputError, match="too large to be mixed"):
        read_volume(spec_of(tmp_path, "a_{}.npy", time=0.5, interpolate=True, nodata="none"))


def test_steps_have_one_shape_type_and_grid(tmp_path: Path) -> None:
    save(tmp_path, "a_0.npy")
    np.save(tmp_path / "a_1.npy", RAMP[:1])
    np.save(tmp_path / "a_2.npy", RAMP.astype(np.float32))
    first = read_volume(spec_of(tmp_path, "a_{}.npy", time=0))
    for time, got in ((1, "4 x 3 x 1 voxels of uint8"), (2, "4 x 3 x 2 voxels of float32")):
        with pytest.raises(InputError, match="the steps of this volume differ") as error:
            read_volume(spec_of(tmp_path, "a_{}.npy", time=time), like=first)
        expected = f"4 x 3 x 2 voxels of uint8, as in {tmp_path / 'a_0.npy'}"
        assert (error.value.where, error.value.got, error.value.expected) == (
            str(tmp_path / f"a_{time}.npy"),
            got,
            expected,
        )
    with pytest.raises(InputError, match="the steps of this volume differ"):
        read_volume(spec_of(tmp_path, "a_{}.npy", time=0.5, interpolate=True))
    for number in range(2):
        affine = np.diag([1.0, 1.0, 1.0, 1.0])
        affine[0, 3] = number
        NIBABEL.Nifti1Image(RAMP.T, affine).to_filename(tmp_path / f"b_{number}.nii")
    with pytest.raises(InputError, match="two steps on different grids") as error:
        read_volume(spec_of(tmp_path, "b_{}.nii", time=0.5, interpolate=True))
    assert "b_1.nii" in str(error.value) and "b_0.nii" in str(error.value)


def test_a_step_with_times_of_its_own_is_refused(tmp_path: Path) -> None:
    for suffix in ("npy", "nii"):
        for number in range(2):
            values = np.stack([RAMP, RAMP])
            if suffix == "npy":
                np.save(tmp_path / f"a_{number}.npy", values)
            else:
                NIBABEL.Nifti1Image(values.T, np.eye(4)).to_filename(tmp_path / f"a_{number}.nii")
        with pytest.raises(InputError, match="a step in time is one volume") as error:
            read_volume(spec_of(tmp_path, f"a_{{}}.{suffix}", time=1))
        assert (error.value.where, error.value.got) == (str(tmp_path / f"a_1.{suffix}"), "2 time steps in this one")


def test_outputs_overwrite_no_step(tmp_path: Path) -> None:
    save(tmp_path, "a_0.npy", "a_1.npy", "a_2.npy")
    scene = scene_of(tmp_path, "a_{}.npy")
    assert {file.name for file in scene_files(scene)} == {"a_0.npy", "a_1.npy", "a_2.npy"}


# When steps are


def times_of(path: Path, **choice: Any) -> tuple[int, Sequence[float], str]:
    volume = read(path, **{"time": 1} | choice)
    first = read_volume(VolumeSpec(FileSource(path), 0))
    found = volume.num_times, volume.times, volume.time_unit
    assert (first.num_times, first.times, first.time_unit) == found
    return found


FOUR = np.stack([RAMP] * 3)


@pytest.mark.parametrize(
    ("unit", "step", "first", "times"),
    [
        ("sec", 0.8, 1.0, (1.0, 1.8, 2.6)),
        ("msec", 500.0, 0.0, (0.0, 0.5, 1.0)),
        ("unknown", 2.0, 0.0, (0.0, 2.0, 4.0)),
        ("hz", 2.0, 0.0, ()),
        ("sec", 0.0, 0.0, ()),
    ],
)
def test_times_of_nifti(tmp_path: Path, unit: str, step: float, first: float, times: tuple[float, ...]) -> None:
    image = NIBABEL.Nifti1Image(FOUR.T, np.eye(4))
    image.header.set_xyzt_units("mm", unit)
    image.header["pixdim"][4], image.header["toffset"] = step, first
    image.to_filename(tmp_path / "a.nii")
    count, found, name = times_of(tmp_path / "a.nii")
    assert (count, name) == (3, "s" if times and unit != "unknown" else "")
    assert found == pytest.approx(times)
    assert read_volume(VolumeSpec(FileSource(tmp_path / "a.nii"), 0.5, interpolate=True)).num_times == 3


@pytest.mark.parametrize(
    ("lines", "times", "unit"),
    [
        ('spacings: 1 1 1 20\naxis mins: nan nan nan 10\nunits: "mm" "mm" "mm" "ms"', (0.01, 0.03, 0.05), "s"),
        ("spacings: 1 1 1 2", (0.0, 2.0, 4.0), ""),
        ('units: "" "" "" "s"', (), ""),
    ],
)
def test_times_of_nrrd(tmp_path: Path, lines: str, times: tuple[float, ...], unit: str) -> None:
    header = "NRRD0004\ntype: uint8\ndimension: 4\nsizes: 4 3 2 3\nencoding: raw\nkinds: domain domain domain time\n"
    written(tmp_path / "a.nrrd", f"{header}{lines}\n\n".encode() + FOUR.tobytes())
    assert times_of(tmp_path / "a.nrrd") == (3, pytest.approx(times), unit)


def save_ome(path: Path, values: Array, metadata: dict[str, Any]) -> None:
    tifffile.imwrite(path, values, metadata={"axes": "TZYX"} | metadata, ome=True, photometric="minisblack")


@pytest.mark.usefixtures("one_process")
def test_times_of_tiff(tmp_path: Path) -> None:
    save_ome(tmp_path / "a.tif", FOUR, {"TimeIncrement": 1.5, "TimeIncrementUnit": "min"})
    assert times_of(tmp_path / "a.tif") == (3, (0.0, 90.0, 180.0), "s")
    planes = {"DeltaT": [0.1 * k**2 for k in range(6)], "DeltaTUnit": ["ms"] * 6}
    save_ome(tmp_path / "b.tif", FOUR, {"Plane": planes})
    assert times_of(tmp_path / "b.tif") == (3, pytest.approx((0.0, 0.0004, 0.0016)), "s")
    save_ome(tmp_path / "c.tif", FOUR, {})
    assert times_of(tmp_path / "c.tif") == (3, (), "")
    tifffile.imwrite(tmp_path / "d.tif", FOUR, imagej=True, metadata={"axes": "TZYX", "finterval": 2.0})
    assert times_of(tmp_path / "d.tif") == (3, (0.0, 2.0, 4.0), "s")
    tifffile.imwrite(tmp_path / "e.tif", FOUR, imagej=True, metadata={"axes": "TZYX", "finterval": 2.0, "tunit": "min"})
    assert times_of(tmp_path / "e.tif") == (3, (0.0, 120.0, 240.0), "s")


@pytest.mark.usefixtures("one_process")
@pytest.mark.parametrize(
    ("fields", "times"),
    [
        ([{"TriggerTime": str(40 * t)} for t in range(3)], (0.0, 0.04, 0.08)),
        ([{"TemporalPositionIdentifier": t + 1} for t in range(3)], ()),
        ([{"TemporalPositionIdentifier": t + 1, "AcquisitionTime": "120000"} for t in range(3)], ()),
        ([{"TemporalPositionIndex": t, "AcquisitionTime": f"1259{50 + t}.5"} for t in range(2, 5)], (0.0, 1.0, 2.0)),
        ([{"AcquisitionDateTime": f"202401012359{t}.25+0100"} for t in (10, 20, 45)], (0.0, 10.0, 35.0)),
    ],
)  # fmt: skip
def test_times_of_dicom(tmp_path: Path, fields: list[dict[str, Any]], times: tuple[float, ...]) -> None:
    for t, own in enumerate(fields):
        for k, plane in enumerate(FOUR[t]):
            number = 2 * t + k
            place = {
                "ImagePositionPatient": ["0", "0", str(k)],
                "ImageOrientationPatient": ["1", "0", "0", "0", "1", "0"],
            }
            uid = {"SOPInstanceUID": f"1.2.3.4.5.{number}", "InstanceNumber": str(number)}
            image_fields(plane, **uid, **place, **own).save_as(tmp_path / f"{number}.dcm", enforce_file_format=False)
    assert times_of(tmp_path) == (3, pytest.approx(times), "s" if times else "")


# What is told of them


def run(command: Any, *arguments: object) -> str:
    result = CliRunner().invoke(command, [*map(str, arguments)], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result.stdout


def test_info_tells_of_steps(tmp_path: Path) -> None:
    save(tmp_path, "a_0.npy", "a_1.npy", "a_2.npy")
    assert "  time         3 steps, a_0.npy to a_2.npy\n" in run(info, tmp_path / "a_{}.npy")
    written(tmp_path / "all.pvd", collection(step(0.5, "a_0.npy"), step(2, "a_1.npy")))
    assert "  time         2 steps, 0.5 to 2, a_0.npy to a_1.npy\n" in run(info, tmp_path / "all.pvd")
    facts = json.loads(run(info, tmp_path / "all.pvd", "--json"))["time"]
    files = [str(tmp_path / f"a_{k}.npy") for k in range(2)]
    assert facts == {"steps": 2, "first_last": [0.5, 2.0], "unit": "", "files": files}
    assert json.loads(run(info, tmp_path / "a_0.npy", "--json"))["time"] is None
    (tmp_path / "scene.yaml").write_text(yaml.safe_dump(OTHERS | {"volume": {"file": "a_{}.npy"}}))
    assert "4 x 3 x 2  3 steps, a_0.npy to a_2.npy" in run(info, tmp_path / "scene.yaml")


def test_init_writes_the_steps(tmp_path: Path) -> None:
    save(tmp_path, "a_0.npy", "a_1.npy")
    run(init, tmp_path / "a_{}.npy", "--output", tmp_path / "scene.yaml")
    tree = yaml.safe_load((tmp_path / "scene.yaml").read_text())
    assert len(tree["volume"]["file"]) == 2
    assert len(source_of(tmp_path, tree["volume"]["file"]).steps) == 2
