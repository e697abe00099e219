"""A scene that is written as plain data reads back the same; wrong data are refused with problems, never a crash."""

from __future__ import annotations

import copy
import json
import math
import random
from collections.abc import Iterator
from dataclasses import MISSING, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, get_args, get_type_hints

import pytest
from film_stages import scheduled
from spoiling import spoil

from renderer.errors import SceneError
from renderer.scene import (
    OPEN_LOOK,
    AnnotationSpec,
    ArraySource,
    CameraSpec,
    ClipSpec,
    ColorBarSpec,
    ColormapSpec,
    ControlPoint,
    EntrySpec,
    EnvironmentSpec,
    ErrorSpec,
    FileSource,
    FilmScene,
    FlightKey,
    FlightPath,
    FogSpec,
    HoldPath,
    ImportedLook,
    Keyframe,
    KeyframePath,
    KeySpec,
    LabelsSpec,
    LayerSpec,
    LightSpec,
    LogoSpec,
    MaskSpec,
    MetricTarget,
    ModeSpec,
    Motion,
    NamesSpec,
    OutputFile,
    OutputSpec,
    PathSequence,
    PlaneSpec,
    ProceduralSource,
    PyramidSpec,
    RawSource,
    RockerPath,
    Scene,
    ShadingSpec,
    SharedKeys,
    SplatBudget,
    SplatSpec,
    TimeBudget,
    TimeSpec,
    TitleSpec,
    TransferSpec,
    TurntablePath,
    UrlSource,
    VolumeSpec,
    moving,
    parse_scene,
    scene_to_dict,
)

HERE = Path(__file__).resolve()
COLLECTION = HERE.parents[1] / "support" / "two_steps.pvd"
COLLECTED = tuple(COLLECTION.with_name(f"{name}_files.py") for name in ("tiff", "volume"))
NUM_BYTES = HERE.stat().st_size
SPACING = (0.1, 1 / 3, 2.0)
AXIS = (1.0, 1e-7, -2.0)
POINTS = (ControlPoint(-0.5, (0.1, 0.2, 0.3), 0.0), ControlPoint(2.0, (1.0, 1.0, 1.0), 1 / 3))

# Together they give every key of a scene a value other than its default.
LAYERS = (
    LayerSpec(
        VolumeSpec(ProceduralSource("constant", (9, 9, 9)), nodata="none"), TransferSpec(POINTS), ShadingSpec(0.1),
        (ClipSpec(PlaneSpec(SPACING, AXIS)),), "one",
        ((1.0, 0.0, 0.5, 3.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 2.0, 0.0), (0.0, 0.0, 0.0, 1.0)), 2.5,
        mask=MaskSpec(VolumeSpec(FileSource(HERE)), LabelsSpec(show=(1,), names=HERE)),
    ),
    LayerSpec(
        VolumeSpec(ProceduralSource("constant", (9, 9, 8))),
        TransferSpec((ControlPoint(1.5, (1.0, 0.0, 0.0), 0.0), ControlPoint(9.0, (1.0, 0.0, 0.0), -math.expm1(-1.0)))),
        color=(1.0, 0.0, 0.0), range=(1.5, 9.0),
    ),
)  # fmt: skip
SHARED = SharedKeys(ShadingSpec(0.7), MaskSpec(VolumeSpec(FileSource(HERE)), LabelsSpec(show=(2,))))
BLUE: dict[str, Any] = {"position": "left", "size": 0.01, "color": (0.0, 0.0, 1.0)}
BAR = EntrySpec(position="top", size=0.25, color=moving(Motion((0, 9), ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)))))
ANNOTATION = AnnotationSpec(
    TitleSpec(**BLUE, text="{a} <b>\\n"),
    LogoSpec(**BLUE, file=HERE),
    TimeSpec(**BLUE, format="{transfer_function.unit:06.1f} {frame:04d} {time}"),
    *(BAR, ColorBarSpec(**BLUE, label="a", length=0.2, layer=0), BAR, BAR, BAR),
    bounds=True,
    font=HERE,
    layout="over",
    color=(0.0, 1 / 3, 0.0),
    size=0.05,
    names=NamesSpec(size=0.25, color=(0.0, 0.0, 1 / 3)),
)
PLAIN = Scene(
    layers=(LayerSpec(VolumeSpec(ProceduralSource("constant", (9, 9, 9))), TransferSpec(POINTS)),),
    camera=CameraSpec(TurntablePath(9)),
    output=OutputSpec(Path("a.mp4")),
)
SECTIONS = {
    "file": Scene(
        layers=(
            LayerSpec(
                VolumeSpec(FileSource(HERE, SPACING), 1, 2, ((0, 1), (0, 2), (1, 3)), (0.1,), "a/b", unit="µm"),
                TransferSpec(ColormapSpec("viridis", (-0.1, 1 / 3), ((0.0, 0.0), (1.0, 0.5)))),
                ShadingSpec(0.1, 0.2, AXIS)),),
        camera=CameraSpec(
            KeyframePath(9, (Keyframe(0, -0.1, 30.5), Keyframe(8, 90.0, 20.0, 2.5)), False, "linear", AXIS),
            "orthographic", 25.5, "visible", 3.5, 0.1, (0.25, -1 / 3)),
        error=ErrorSpec(scheduled((0, 0.5), (7, 1 / 3), (8, 0.0)), "rms", "scalar", 2),
        splat=SplatSpec("gouraud", 0.5, 7, 4, ((0.0, 1.0), (0.1, 0.5), (1.0, 0.0)), False, "boxes"),
        pyramid=PyramidSpec("opacity", "single"),
        annotation=AnnotationSpec(octree=True),
        output=OutputSpec(Path("{frame}.png"), (7, 9), background=None, dpi=300.5)),
    "raw": Scene(
        layers=(
            LayerSpec(
                VolumeSpec(RawSource(HERE, (1, 1, NUM_BYTES - 3), "uint8", "big", SPACING, 3), nodata=(-1.0, 1e20)),
                TransferSpec(POINTS, 0.1),
                ShadingSpec(occlusion=0.7, shadow=1 / 3, occlusion_radius=12.5, cut_faces=False)),),
        camera=CameraSpec(RockerPath(9, 33.3, 0.1, -10.5, AXIS), target=(1.0, 2.0, 1 / 3)),
        error=ErrorSpec(goal=SplatBudget(scheduled((0, 1000), (8, 10_000)))),
        output=OutputSpec(
            Path("a.mp4"), (512, 512), 12.5, (0.1, 0.2, 0.3), 3.3, codec="hevc", crf=9.5,
            pixel_format="yuv420p10")),
    "procedural": Scene(
        layers=(
            LayerSpec(
                VolumeSpec(ProceduralSource("constant", (9, 9, 9), 7, SPACING), crop=(None, (1, 8), None)),
                TransferSpec(POINTS),
                ShadingSpec(0.1, 0.2, "camera", 0.3, 1000.0, True, ((0.0, 1 / 3), (1e9, 1.0)), silhouette=0.5)),),
        camera=CameraSpec(TurntablePath(9, 0.1, 12.5, AXIS)),
        error=ErrorSpec(goal=MetricTarget("psnr", 30.1), probes=64),
        clip=(ClipSpec(PlaneSpec(SPACING, AXIS), None, "camera", True), ClipSpec(None, (AXIS, (2.0, 1e-6, 1 / 3)))),
        output=OutputSpec(
            Path("b/c.gif"),
            others=(
                OutputFile(Path("a.webm"), (256, 256), 10.0, None, 3.0, "vp9", 12.0, "yuva420p", every=2),
                OutputFile(Path("p.png"), background=((1.0, 0.0, 0.0), (0.0, 0.0, 0.0)), frame=1, dpi=72.0)))),
    "url": PLAIN.with_layers(volume=VolumeSpec(UrlSource("s3://a.bucket/b.zarr", SPACING), level=3)),
    "attenuation": replace(PLAIN, mode=ModeSpec("attenuation", 0.1, -1000.0)).with_layers(
        transfer_function=TransferSpec(ColormapSpec("gray", (0.5, 1.0), ((0.5, 1.0),), "log"), relative=True)),
    "light": replace(
        PLAIN,
        light=LightSpec(
            EnvironmentSpec((0.1, 0.2, 0.3), (0.4, 0.5, 0.6), (0.0, 0.0, 1 / 3)), AXIS,
            KeySpec(moving(Motion((0, 7), (AXIS, (0.0, 0.0, 1.0)), kind="direction")), (0.5, 1.0, 0.0), 1 / 3, 0.5),
            scattering=1 / 3, surface=0.7, specular=0.1, shininess=12.5, exposure=-2.25, cells=200)),
    "light of the camera": replace(PLAIN, light=LightSpec(key=KeySpec("camera"))),
    "fog": replace(PLAIN, fog=FogSpec((-1 / 3, 2.5), moving(Motion((0, 7), ((1.0, 0.0, 0.0), (0.0, 0.5, 1.0)))))),
    "light as it is": replace(PLAIN, light=LightSpec()),
    "depth": replace(PLAIN, mode=ModeSpec("maximum", color_by="depth")),
    "volumes": replace(PLAIN, layers=LAYERS, shared=SharedKeys(), blend="add"),
    "volumes with one shading": replace(
        PLAIN, layers=(LAYERS[0], replace(LAYERS[1], shading=SHARED.shading, mask=SHARED.mask)), shared=SHARED),
    "a volume in a list": replace(PLAIN, shared=SharedKeys()),
    "labels": PLAIN.with_layers(
        transfer_function=TransferSpec(
            LabelsSpec(
                ((3, (1.0, 0.0, 0.5)), ("a b", (0.0, 0.0, 0.0))), ((3, 0.5), ("a b", 1 / 3)), (3, "a b", -7), (9,),
                ((3, "three"), (-7, "a b"))),
            2.5),
        mask=MaskSpec(VolumeSpec(FileSource(HERE)), transform=LAYERS[0].transform)),
    "motion": Scene(
        layers=(
            LayerSpec(
                VolumeSpec(ProceduralSource("constant", (9, 9, 9), phase=0.25)),
                TransferSpec(
                    moving(Motion((0, 6), (POINTS, (POINTS[0], replace(POINTS[1], color=(0.0, 0.5, 1.0)))), "smooth")),
                    moving(Motion((1, 3, 5), (1.0, 0.1, 2.0), "hold", "ratio"))),
                ShadingSpec(light=moving(Motion((0, 7), ((1.0, 0.0, 0.0), AXIS), kind="direction")))),),
        camera=CameraSpec(
            PathSequence(
                (
                    TurntablePath(3, elevation=moving(Motion((0, 2), (0.0, 12.5)))), HoldPath(2),
                    FlightPath(
                        3, (FlightKey(SPACING, AXIS, 12.5, 0), FlightKey(AXIS, SPACING, frame=2)), "smooth", AXIS))),
            target="visible", follow=True, loop="ping-pong"),
        annotation=replace(ANNOTATION, legend=None, names=None),
        output=OutputSpec(
            Path("a.mp4"), background=moving(Motion((0, 13), ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0)), "in")))),
    "labels in a list": replace(
        PLAIN, layers=(LayerSpec(LAYERS[1].volume, TransferSpec(LabelsSpec("table", 0.5))), LAYERS[0]),
        shared=SharedKeys(), camera=CameraSpec(TurntablePath(12)),
        annotation=replace(ANNOTATION, time=TimeSpec(**BLUE, format="{frame:04d}"))),
    "steps": PLAIN.with_layers(
        volume=VolumeSpec(FileSource(HERE, SPACING, (HERE, HERE)), "auto"),
        mask=MaskSpec(VolumeSpec(FileSource(HERE, steps=(HERE,)), 0))),
    "channels": PLAIN.with_layers(volume=VolumeSpec(FileSource(HERE), component="all"), transfer_function=OPEN_LOOK),
    "channels of one look": PLAIN.with_layers(
        volume=VolumeSpec(FileSource(HERE), component="all"),
        transfer_function=TransferSpec(
            (ControlPoint(0.0, (1.0, 1.0, 1.0), 0.0), ControlPoint(1.0, (1.0, 1.0, 1.0), 1.0)))),
    "collection": PLAIN.with_layers(
        volume=VolumeSpec(
            FileSource(COLLECTION.with_name("tiff_files.py"), None, COLLECTED, (0.5, 2.5), COLLECTION),
            moving(Motion((0, 8), (0.0, 1.0))), interpolate=True)),
    "time budget": replace(PLAIN, error=ErrorSpec(goal=TimeBudget(0.1)), splat=SplatSpec(order="unmixed")),
}  # fmt: skip
SCENES = {name: sections.changed(lambda each: each) for name, sections in SECTIONS.items()}


def parse(tree: object) -> FilmScene:
    return parse_scene(tree, base=HERE.parent)


@pytest.mark.parametrize("name", SCENES)
def test_plain_data_make_the_same_scene(name: str) -> None:
    plain = scene_to_dict(SCENES[name])
    assert parse(plain) == SCENES[name]
    assert parse(json.loads(json.dumps(plain))) == SCENES[name]


def test_these_scenes_change_every_key() -> None:
    found = [part for scene in SECTIONS.values() for part in parts(scene)]
    assert {type(part) for part in found} == set(spec_types(Scene)) - {ArraySource, ImportedLook}
    for cls in {type(part) for part in found}:
        for field in fields(cls):
            values = [getattr(part, field.name) for part in found if type(part) is cls]
            is_varied = field.default is MISSING or any(value != field.default for value in values)
            # An imported transfer function is read as control points, and recorded as these.
            is_of_others = (cls, field.name) in _OF_OTHERS
            assert is_varied or is_of_others or field.name in ("imported", "chosen"), f"{cls.__name__}.{field.name}"


# The first output has every frame.
_OF_OTHERS = {(OutputSpec, "every"), (OutputSpec, "frame")}


def spec_types(hint: Any) -> Iterator[type[Any]]:
    """Yield the dataclasses that a type is made of."""
    for part in get_args(hint):
        yield from spec_types(part)
    if isinstance(hint, type) and is_dataclass(hint):
        yield hint
        for part in get_type_hints(hint).values():
            yield from spec_types(part)


def parts(value: Any) -> Iterator[Any]:
    """Yield every dataclass in a scene."""
    if is_dataclass(value):
        if not isinstance(value, Motion):
            yield value
        value = tuple(getattr(value, field.name) for field in fields(value))
    for item in value if isinstance(value, tuple) else ():
        yield from parts(item)


JUNK: list[Any] = [
    None, True, False, 0, -1, 3, 1e300, math.nan, math.inf, 10**400, 9**5000, "", "\0", "\ud800", "{frame}", "1e-3",
    "1e999999999", "9" * 5000, "~", "a" * 5000, "transparent", "#ffffff", "rocker", [], [0], [0, 1], [1, 2, 3],
    [[0, 1]], [[1, 2], [3, 4], [5, 6]], [None] * 3, {}, {"a": 1}, {0: 1}, {None: 2}, {1.5: 2}, {True: {}}, b"x", (1, 2),
]  # fmt: skip
KEYS = ["x", 0, None, True, "fram", "axi", "points", "colormap", "raw", "\x1b", "a.b", 9**5000]


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_spoilt_data_are_refused_or_make_a_scene(name: str) -> None:
    choose = random.Random(1)
    num_read, refusals = 0, list[str]()
    whole = scene_to_dict(SCENES[name])
    spoilt = [copy.deepcopy(whole) for _ in range(100)]
    for tree in spoilt:
        for _ in range(choose.randint(1, 4)):
            spoil(tree, choose, JUNK, KEYS)
    for tree in spoilt:
        try:
            scene = parse(tree)
        except SceneError as error:
            refusals.append(str(error))
        else:
            num_read += 1
            assert parse(scene_to_dict(scene)) == scene
    assert all(text and "object at" not in text for text in refusals)
    assert 0 < num_read < 90


@pytest.mark.parametrize("junk", JUNK, ids=lambda _: "")
def test_junk_is_refused(junk: object) -> None:
    with pytest.raises(SceneError) as refused:
        parse(junk)
    assert "object at" not in str(refused.value)
