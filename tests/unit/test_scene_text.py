"""The text of a suggested scene reads back as what it was written from, with any names and numbers."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, strategies as st

from hsplat_cli.scenes import compose_scene, yaml_string
from renderer.scene import (
    ColormapSpec,
    ControlPoint,
    FileSource,
    LabelKey,
    LabelsSpec,
    LayerSpec,
    RawSource,
    Scene,
    ShadingSpec,
    TransferSpec,
    TurntablePath,
    VolumeSpec,
    format_value,
    load_scene,
    parse_yaml,
    ramp,
)
from renderer.suggest import FilmOptions, Suggestion, VolumeSuggestion
from renderer.system import printable

POINTS = (ControlPoint(-1e-7, (0.0, 0.0, 0.0), 0.0), ControlPoint(3.0, (1.0, 0.2, 0.4), 0.999))
SUGGESTION = Suggestion("scan", "it has edges", TransferSpec(POINTS, 0.5), ("", "the object"), ShadingSpec())

DEFAULT = FilmOptions()

_NO_BRACES = str.maketrans("{}", "__")

NAMES = [
    "scan.npy", "a scan.npy", 'it\'s "quoted".npy', "key: value.npy", "# comment.npy", "-dash.npy", "new\nline.npy",
    "tab\tand\x7f.npy", "Größe 数据 🙂.npy", "\u2028\x85.npy", "null", "1e3", "back\\slash.npy", "{frame}.npy",
    "&anchor *alias !tag %.npy", os.fsdecode(b"bytes \xff\xfe.npy"),
]  # fmt: skip


def read_back(
    found: VolumeSuggestion, folder: Path, film: FilmOptions = DEFAULT, output: Path = Path("film.mp4")
) -> tuple[str, Scene]:
    """Return the text of a scene in a folder, and the scene that is read from it."""
    text = compose_scene(found, film, folder=folder, output=output)
    (folder / "scene.yaml").write_bytes(text.encode())
    return text, load_scene(folder / "scene.yaml")


@pytest.mark.parametrize("name", NAMES)
def test_every_file_name_reads_back(folder: Path, name: str) -> None:
    """The scene's folder is neither the volume's nor the current one."""
    Path("data").mkdir()
    Path("scenes").mkdir()
    volume = Path("data", name)
    volume.touch()
    found = VolumeSuggestion(VolumeSpec(FileSource(volume)), SUGGESTION, has_absent=False)
    output = Path("out", f"{name}.mp4".translate(_NO_BRACES))
    _, scene = read_back(found, Path("scenes"), output=output)
    assert isinstance(scene.layers[0].volume.source, FileSource)
    assert scene.layers[0].volume.source.file.samefile(volume)
    assert scene.output.file == output


def test_every_setting_reads_back(tmp_path: Path) -> None:
    (tmp_path / "a.raw").write_bytes(bytes(12 + 48))
    source = RawSource(tmp_path / "a.raw", (2, 3, 4), "int16", "big", (0.5, 1.0, 1e-5), 12)
    film = FilmOptions(7, -12.5, "-x", 1e-9, (640, 480), 12.5, "#ff8000")
    colormap = TransferSpec(ColormapSpec("viridis", (-1.0, 1e22), ((0.0, 0.0), (1e-9, 0.25))), 1e-7)
    suggestion = Suggestion("a kind", "a reason", colormap, (), None)
    found = VolumeSuggestion(VolumeSpec(source, nodata=(1.5,)), suggestion, has_absent=True)
    _, scene = read_back(found, tmp_path, film)
    assert scene.layers[0].volume == VolumeSpec(source, nodata=(1.5,))
    assert scene.layers[0].transfer_function == colormap
    assert scene.layers[0].shading is None
    assert scene.camera.path == TurntablePath(7, elevation=-12.5, axis=(-1.0, 0.0, 0.0))
    assert scene.camera.target == "visible"
    assert scene.error.tolerance == 1e-9
    assert (scene.output.size, scene.output.frames_per_second) == ((640, 480), 12.5)
    assert scene.output.background == pytest.approx((1.0, 128 / 255, 0.0))


def test_a_spacing_and_a_choice_of_voxels_read_back(tmp_path: Path) -> None:
    source = FileSource(tmp_path / "a.npy", (1e-7, 2e-7, 3e-3))
    source.file.touch()
    volume = VolumeSpec(source, time=3, component=1)
    found = VolumeSuggestion(volume, SUGGESTION, has_absent=False)
    text, scene = read_back(found, tmp_path)
    assert scene.layers[0].volume == volume
    assert "  spacing: [1e-07, 2e-07, 0.003]  # size of a voxel, in place of the file's\n" in text


@pytest.mark.parametrize("opacity", [1e-9, ((-3, 0.25), (2**53, 1.0), *((value, 0.5) for value in range(60)))])
def test_labels_read_back(tmp_path: Path, opacity: float | tuple[tuple[LabelKey, float], ...]) -> None:
    """With any names: alone, and over another volume."""
    values, named = (-3, *range(60), 2**53), [name for name in NAMES if name.isprintable()]
    colors = tuple((value, (0.2, (value % 6) / 5, 1.0)) for value in values)
    labels = LabelsSpec(colors, opacity, values, names=tuple(zip(values, named, strict=False)))
    suggestion = Suggestion("labels", "a reason", TransferSpec(labels, 0.5), (), ShadingSpec())
    for name in ("parts.npy", "scan.npy"):
        (tmp_path / name).touch()
    parts, scan = (VolumeSpec(FileSource(tmp_path / name)) for name in ("parts.npy", "scan.npy"))
    found = VolumeSuggestion(parts, suggestion, has_absent=False)
    under = VolumeSuggestion(scan, SUGGESTION, has_absent=False)
    for below, place in ((None, 0), (under, 1)):
        text = compose_scene(found, DEFAULT, folder=tmp_path, output=Path("film.mp4"), under=below)
        (tmp_path / "scene.yaml").write_text(text, "utf-8")
        layers = load_scene(tmp_path / "scene.yaml").layers
        assert len(layers) == 1 + place and layers[0].volume == parts
        read = layers[0].transfer_function
        assert read.unit == 0.5 and read.labels is not None
        assert (read.labels.styles, read.labels.values) == (labels.styles, labels.values)
        assert ("# Which labels are shown" in text) == (below is None)


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_any_number_reads_back(value: float) -> None:
    assert parse_yaml(f"a: {format_value(value)}").data == {"a": value}


@given(st.text(st.characters(exclude_categories=["Cs"])))
def test_any_text_reads_back(text: str) -> None:
    assert parse_yaml(f"a: {yaml_string(text)}").data == {"a": text}
    assert parse_yaml(f"a: 1 # {printable(text)}").data == {"a": 1}


def test_the_annotation_that_is_offered_is_one_that_the_scene_can_have(folder: Path) -> None:
    Path("scan.npy").touch()
    red, volume = (1.0, 0.0, 0.0), VolumeSpec(FileSource(Path("scan.npy")))
    labels = LabelsSpec(((3, red),), 1.0, (3,))
    of_labels = Suggestion("labels", "a reason", TransferSpec(labels, 0.5), (), ShadingSpec())
    channel = LayerSpec(volume, ramp(red, (10.0, 20.0)), color=red, range=(10.0, 20.0))
    colors = replace(volume, component="color_alpha")
    for found, entries in (
        (VolumeSuggestion(volume, SUGGESTION, has_absent=False), {"color_bar", "scale_bar"}),
        (VolumeSuggestion(volume, SUGGESTION, has_absent=False, layers=(channel,) * 2), {"legend", "scale_bar"}),
        (VolumeSuggestion(volume, of_labels, has_absent=False), {"names"}),
        (VolumeSuggestion(colors, replace(SUGGESTION, shading=None), has_absent=False), {"scale_bar"}),
    ):
        text, scene = read_back(found, folder)
        assert not scene.annotation.shows_anything
        Path("scene.yaml").write_text(text.replace("# annotation: {", "annotation: {"))
        annotation = load_scene(folder / "scene.yaml").annotation
        assert {*annotation.entries, *["names"] * (annotation.names is not None)} == entries
