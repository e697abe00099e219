"""A Scene survives the way to plain data and back, and spoilt data give complaints and nothing else."""

from __future__ import annotations

import copy
import json
import math
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import assume, given, settings, strategies as st

from renderer.errors import SceneError
from renderer.scene import (
    MAX_LEVEL,
    MIN_WORLD_LENGTH,
    PROCEDURAL_NAMES,
    ByFrame,
    CameraSpec,
    ColormapSpec,
    ControlPoint,
    ErrorSpec,
    FileSource,
    KeyframePath,
    MetricTarget,
    OutputSpec,
    ProceduralSource,
    PyramidSpec,
    RawSource,
    RockerPath,
    Scene,
    ShadingSpec,
    SplatBudget,
    SplatSpec,
    TimeBudget,
    TransferSpec,
    TurntablePath,
    VolumeSpec,
    scene_to_dict,
)
from renderer.scene.camera_section import Keyframe
from renderer.scene.error_section import LONGEST_S, MAX_PSNR_DB, MAX_SPLATS, MIN_SECONDS
from renderer.scene.limits import proportion_problems
from renderer.scene.parse import parse_scene

HERE = Path(__file__).resolve()
FILE_BYTES = HERE.stat().st_size


def finite(low: float = -1e6, high: float = 1e6) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False)


PART = finite(0, 1)
POSITIVE = finite(1e-6, 1e6)
VECTOR = st.tuples(finite(), finite(), finite())
DIRECTION = VECTOR.filter(lambda vector: max(map(abs, vector)) >= MIN_WORLD_LENGTH)
SPACING = st.tuples(*[finite(0.01, 100)] * 3)
SHAPE = st.tuples(*[st.integers(8, 64)] * 3)
COLOR = st.tuples(PART, PART, PART)
CROP = st.none() | st.tuples(*[st.tuples(st.integers(0, 3), st.integers(4, 8))] * 3)
NONFINITE = st.sampled_from(["error", "lowest"]) | finite()


def raw_sources() -> st.SearchStrategy[RawSource]:
    """Sources that fit this very file."""
    return st.builds(
        lambda num, order, spacing: RawSource(HERE, (1, 1, num), "uint16", order, spacing, FILE_BYTES - 2 * num),
        st.integers(1, FILE_BYTES // 2),
        st.sampled_from(["little", "big"]),
        SPACING,
    )


VOLUMES = st.one_of(
    st.builds(
        VolumeSpec,
        source=st.builds(FileSource, st.just(HERE), st.none() | SPACING),
        time=st.none() | st.integers(0, 99),
        component=st.none() | st.integers(0, 99),
        crop=CROP,
        nonfinite=NONFINITE,
    ),
    st.builds(VolumeSpec, source=raw_sources(), nonfinite=NONFINITE),
    st.builds(
        VolumeSpec,
        source=st.builds(
            ProceduralSource, st.sampled_from(PROCEDURAL_NAMES), SHAPE, st.integers(0, 2**32 - 1), SPACING
        ),
        crop=CROP,
        nonfinite=NONFINITE,
    ),
)
VALUES = st.lists(finite(), min_size=1, max_size=5, unique=True).map(sorted)
MAPPINGS = st.one_of(
    VALUES.flatmap(
        lambda values: st.tuples(*[st.builds(ControlPoint, st.just(value), COLOR, finite(0.01, 1)) for value in values])
    ),
    st.builds(
        ColormapSpec,
        st.sampled_from(["viridis", "matplotlib:bwr", "crameri:batlow_r", "Gray"]),
        st.tuples(finite(-100, 0), finite(1, 100)),
        VALUES.flatmap(lambda values: st.tuples(*[st.tuples(st.just(value), finite(0.01, 1)) for value in values])),
    ),
)
ELEVATION = finite(-90, 90)


def paths(frames: int) -> st.SearchStrategy[Any]:
    keys = st.lists(st.integers(0, frames - 1), min_size=1, max_size=4, unique=True).map(sorted)
    return st.one_of(
        st.builds(TurntablePath, st.just(frames), finite(), ELEVATION, DIRECTION),
        st.builds(RockerPath, st.just(frames), finite(0.1, 360), finite(), ELEVATION, DIRECTION),
        st.builds(
            KeyframePath,
            st.just(frames),
            keys.flatmap(
                lambda at: st.tuples(*[st.builds(Keyframe, st.just(f), finite(), ELEVATION, POSITIVE) for f in at])
            ),
            st.booleans(),
            st.sampled_from(["smooth", "linear"]),
            DIRECTION,
        ),
    )


def by_frame(frames: int, value: st.SearchStrategy[Any]) -> st.SearchStrategy[ByFrame]:
    """One value for all, or some by frame."""
    several = st.dictionaries(st.integers(0, frames - 1), value, min_size=1, max_size=4)
    return st.one_of(value.map(lambda at: ((0, at),)), several.map(lambda d: tuple(sorted(d.items()))))


def errors(frames: int) -> st.SearchStrategy[ErrorSpec]:
    """With a tolerance, which may be 0 where it stays so, or with a goal."""
    tolerance = st.one_of(st.just(((0, 0.0),)), st.just(((frames - 1, 0.0),)), by_frame(frames, POSITIVE))
    goal = st.one_of(
        st.builds(SplatBudget, by_frame(frames, st.integers(1, MAX_SPLATS))),
        st.builds(TimeBudget, by_frame(frames, finite(MIN_SECONDS, LONGEST_S))),
        st.builds(MetricTarget, st.just("psnr"), finite(1e-6, MAX_PSNR_DB)),
        st.builds(MetricTarget, st.just("rmse"), finite(1e-6, 1)),
    )
    measures = st.sampled_from([("optical", "classified"), ("rms", "classified"), ("rms", "scalar")])
    levels = st.integers(0, MAX_LEVEL)
    return st.one_of(
        st.builds(lambda at, pair, level: ErrorSpec(at, *pair, level), tolerance, measures, levels),
        st.builds(lambda at, pair, level: ErrorSpec(ErrorSpec.tolerance, *pair, level, at), goal, measures, levels),
    )


ORDER = st.sampled_from(["depth", "unmixed", "boxes"])
SPLATS = st.one_of(
    st.builds(SplatSpec, st.just("gaussian"), finite(0.38, 2), opacity_correction=st.booleans(), order=ORDER),
    st.builds(
        SplatSpec,
        st.just("gouraud"),
        finite(0.38, 2),
        st.integers(3, 64),
        st.integers(1, 32),
        st.builds(lambda middle, at: ((0.0, 1.0), (at, middle), (1.0, 0.0)), PART, finite(0.1, 0.9)),
        order=ORDER,
    ),
    st.just(SplatSpec("integrated")),
)
OUTPUTS = st.one_of(
    st.builds(
        OutputSpec,
        st.sampled_from([Path("a.mp4"), Path("b/c.gif")]),
        st.tuples(st.integers(1, 99), st.integers(1, 99)).map(lambda size: (2 * size[0], 2 * size[1])),
        finite(0.01, 50),
        COLOR,
        finite(0, 10),
    ),
    st.builds(
        OutputSpec, st.just(Path("{frame:04}.png")), st.tuples(*[st.integers(1, 99)] * 2), background=st.none() | COLOR
    ),
)


@st.composite
def scenes(draw: st.DrawFn) -> Scene:
    frames = draw(st.integers(1, 10**6))
    camera = st.builds(
        CameraSpec,
        paths(frames),
        st.sampled_from(["perspective", "orthographic"]),
        finite(1, 179),
        st.one_of(st.none(), st.just("visible"), VECTOR),
        st.none() | POSITIVE,
        finite(0, 10),
    )
    scene = Scene(
        volume=draw(VOLUMES),
        transfer_function=draw(st.builds(TransferSpec, MAPPINGS, st.none() | POSITIVE)),
        camera=draw(camera),
        output=draw(OUTPUTS),
        error=draw(errors(frames)),
        splat=draw(SPLATS),
        pyramid=draw(
            st.builds(PyramidSpec, st.sampled_from(["extinction", "opacity"]), st.sampled_from(["half", "single"]))
        ),
        shading=draw(st.none() | st.builds(ShadingSpec, PART, PART, DIRECTION)),
        overlay=draw(st.sampled_from(["none", "octree"])),
    )
    assume(not list(proportion_problems(scene)))
    return scene


@settings(max_examples=40, deadline=None, derandomize=True)
@given(scene=scenes())
def test_plain_data_make_the_same_scene_again(scene: Scene) -> None:
    plain = scene_to_dict(scene)
    assert parse(plain) == scene
    assert parse(json.loads(json.dumps(plain))) == scene


# Anything at all

JUNK: list[Any] = [
    None,
    True,
    False,
    0,
    -1,
    3,
    1e300,
    math.nan,
    math.inf,
    10**400,
    9**5000,
    "",
    "\0",
    "\ud800",
    "{frame}",
]
JUNK += [
    "1e-3",
    "1e999999999",
    "9" * 5000,
    "~",
    "a" * 5000,
    "transparent",
    "#ffffff",
    "rocker",
    [],
    [0],
    [0, 1],
    [1, 2, 3],
]
JUNK += [
    [[0, 1]],
    [[1, 2], [3, 4], [5, 6]],
    [None] * 3,
    {},
    {"a": 1},
    {0: 1},
    {None: 2},
    {1.5: 2},
    {True: {}},
    b"x",
    (1, 2),
]
KEYS = ["x", 0, None, True, "fram", "axi", "points", "colormap", "raw", "\x1b", "a.b", 9**5000]


def places(tree: Any) -> Iterator[tuple[Any, Any]]:
    """Every (container, key) in a tree."""
    for key, value in tree.items() if isinstance(tree, dict) else enumerate(tree):
        yield tree, key
        if isinstance(value, (dict, list)):
            yield from places(value)


def spoilt(tree: dict[str, Any], choose: random.Random) -> dict[str, Any]:
    """The tree with one to four random things added, removed or replaced by junk."""
    tree = copy.deepcopy(tree)
    for _ in range(choose.randint(1, 4)):
        every = list(places(tree))
        if not every:
            break
        container, key = choose.choice(every)
        action = choose.random()
        if action < 0.2 and isinstance(container, dict):
            container[choose.choice(KEYS)] = copy.deepcopy(choose.choice(JUNK))
        elif action < 0.4:
            del container[key]
        else:
            container[key] = copy.deepcopy(choose.choice(JUNK))
    return tree


SPOILT = [
    Scene(
        volume=VolumeSpec(FileSource(HERE), time=1, crop=((0, 1), (0, 2), (1, 3))),
        transfer_function=TransferSpec(ColormapSpec("viridis", (0, 1), ((0, 0), (1, 1)))),
        camera=CameraSpec(KeyframePath(9, (Keyframe(0, 0, 0), Keyframe(8, 90, 20, 2))), target="visible", distance=3),
        error=ErrorSpec(((0, 0.5), (8, 0.1)), measure="rms", of="scalar"),
        splat=SplatSpec("gouraud"),
        shading=ShadingSpec(),
        output=OutputSpec(Path("{frame}.png"), background=None),
    ),
    Scene(
        volume=VolumeSpec(RawSource(HERE, (1, 1, FILE_BYTES - 1), "uint8", offset=1)),
        transfer_function=TransferSpec((ControlPoint(0, (0, 0, 0), 0), ControlPoint(1, (1, 1, 1), 1)), 2),
        camera=CameraSpec(RockerPath(9), target=(1, 2, 3)),
        error=ErrorSpec(goal=SplatBudget(((0, 1000), (8, 10_000)))),
        output=OutputSpec(Path("a.mp4")),
    ),
    Scene(
        volume=VolumeSpec(ProceduralSource("constant", (9, 9, 9))),
        transfer_function=TransferSpec((ControlPoint(0, (0, 0, 0), 1),)),
        camera=CameraSpec(TurntablePath(9)),
        error=ErrorSpec(goal=MetricTarget("psnr", 30.0)),
        splat=SplatSpec(order="unmixed"),
        output=OutputSpec(Path("a.gif")),
    ),
]


@pytest.mark.parametrize("scene", SPOILT, ids=["file", "raw", "procedural"])
def test_spoilt_scenes_give_complaints_and_nothing_else(scene: Scene) -> None:
    plain = scene_to_dict(scene)
    assert parse(plain) == scene
    choose = random.Random(1)
    for _ in range(600):
        text = complaint(spoilt(plain, choose))
        assert text != ""
        assert "INVALID" not in (text or "")


@pytest.mark.parametrize("tree", JUNK, ids=range(len(JUNK)))
def test_what_is_no_tree_gives_complaints(tree: object) -> None:
    assert complaint(tree)


def parse(tree: object) -> Scene:
    return parse_scene(tree, base=HERE.parent)


def complaint(tree: object) -> str | None:
    try:
        parse(tree)
    except SceneError as error:
        return str(error)
    return None
