"""Any legal scene gives a picture or an error that says why not: never a NaN, a warning or a traceback.

Numbers are drawn evenly in their logarithm over the whole range that the schema allows, both ends included.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import HealthCheck, given, settings, strategies as st

from renderer.draw import Rasterizer
from renderer.errors import InputError
from renderer.frame import prepare_stage, render_frames
from renderer.scene import MAX_WORLD_LENGTH, MIN_TOLERANCE, MIN_WORLD_LENGTH, PROCEDURAL_NAMES, Scene, parse_scene
from renderer.scene.camera_section import MAX_ANGLE, MAX_FIELD_OF_VIEW, MAX_ZOOM, MIN_FIELD_OF_VIEW, MIN_ZOOM

Numbers = st.SearchStrategy[float]

# Of a picture that adds up to 1: what float32 rounds in a few hundred layers.
ROUNDING = 1e-4

LARGEST_VALUE = 1.7e308


def size(least: float, most: float) -> Numbers:
    exponent = st.floats(math.log10(least), math.log10(most))
    return st.one_of(st.sampled_from([least, most]), exponent.map(lambda e: min(max(10**e, least), most)))


def signed(least: float, most: float) -> Numbers:
    return st.one_of(st.just(0.0), size(least, most), size(least, most).map(lambda value: -value))


def one_of(*words: str) -> st.SearchStrategy[str]:
    return st.sampled_from(words)


def maybe(**fields: st.SearchStrategy[Any]) -> st.SearchStrategy[dict[str, Any]]:
    return st.fixed_dictionaries({}, optional=fields)


LENGTH = size(MIN_WORLD_LENGTH, MAX_WORLD_LENGTH)
NEAR_ONE = size(1e-3, 1e3)
COORDINATE = signed(MIN_WORLD_LENGTH, MAX_WORLD_LENGTH)
ANGLE = signed(1e-300, MAX_ANGLE)
ELEVATION = signed(1e-300, 90)
DIRECTION = st.tuples(*[COORDINATE] * 3).filter(any).map(list)
PART = st.one_of(st.sampled_from([0.0, 1.0, 1 - 2**-53]), size(1e-300, 1.0))
COLOR = st.tuples(PART, PART, PART).map(list)


@st.composite
def transfers(draw: st.DrawFn) -> dict[str, Any]:
    """Points where the voxels have values, or anywhere, the last one visible."""
    values = sorted(
        draw(st.lists(st.one_of(st.floats(0, 255), signed(1e-300, LARGEST_VALUE)), min_size=1, max_size=4, unique=True))
    )
    points = [{"value": value, "color": draw(COLOR), "opacity": draw(PART)} for value in values]
    points[-1]["opacity"] = draw(size(1e-300, 1.0))
    return {"points": points} | draw(maybe(unit=st.one_of(NEAR_ONE, LENGTH)))


@st.composite
def cameras(draw: st.DrawFn, frames: int, scale: float) -> dict[str, Any]:
    """Lengths like the volume's, or any."""
    length = st.one_of(
        size(1e-2, 1e2).map(lambda share: share * scale), size(1e-14, 1e14).map(lambda s: s * scale), LENGTH
    )
    length = length.map(lambda value: min(max(value, MIN_WORLD_LENGTH), MAX_WORLD_LENGTH))
    place = st.tuples(*[st.one_of(st.just(0.0), length, length.map(lambda value: -value))] * 3).map(list)
    key = st.fixed_dictionaries(
        {"azimuth": ANGLE, "elevation": ELEVATION}, optional={"zoom": st.one_of(NEAR_ONE, size(MIN_ZOOM, MAX_ZOOM))}
    )
    keys = st.lists(key, min_size=1, max_size=frames).map(lambda keys: [{"frame": i} | k for i, k in enumerate(keys)])
    turns = {"start": ANGLE, "elevation": ELEVATION}
    path = draw(
        st.one_of(
            maybe(**turns).map(lambda rest: {"type": "turntable"} | rest),
            maybe(**turns, swing=size(1e-300, 360)).map(lambda rest: {"type": "rocker"} | rest),
            keys.map(lambda keys: {"type": "keyframes", "keys": keys}),
        )
    )
    lens = maybe(
        projection=one_of("perspective", "orthographic"),
        field_of_view=st.one_of(st.floats(1, 120), size(MIN_FIELD_OF_VIEW, MAX_FIELD_OF_VIEW)),
        target=st.one_of(st.just("visible"), place),
        distance=length,
        near=st.one_of(st.just(0.0), length),
    )
    return draw(lens) | {"path": path | {"frames": frames} | draw(maybe(axis=DIRECTION))}


@st.composite
def scenes(draw: st.DrawFn) -> dict[str, Any]:
    frames = draw(st.integers(1, 3))
    side = draw(st.one_of(NEAR_ONE, LENGTH))
    ratios = draw(st.tuples(*[st.one_of(st.just(1.0), size(3e-3, 3e2))] * 3))
    spacing = [min(max(side * ratio, MIN_WORLD_LENGTH), MAX_WORLD_LENGTH) for ratio in ratios]
    shape = draw(st.tuples(*[st.integers(1, 5)] * 3))
    tolerance = size(MIN_TOLERANCE, 1.7e308)
    volume = {"name": draw(st.sampled_from(PROCEDURAL_NAMES)), "shape": list(shape), "spacing": spacing}
    by_frame = st.lists(tolerance, min_size=frames, max_size=frames).map(enumerate).map(dict)
    tolerances = st.one_of(st.just(0.0), size(1e-3, 1), tolerance, by_frame)
    splats = maybe(
        footprint=one_of("gaussian", "gouraud"), sigma=st.floats(0.38, 2), order=one_of("depth", "unmixed", "boxes")
    )
    scene = {
        "volume": {"procedural": volume},
        "transfer_function": draw(transfers()),
        "camera": draw(cameras(frames, max(n * s for n, s in zip(shape, spacing, strict=True)))),
        "error": draw(maybe(measure=one_of("optical", "rms"), tolerance=tolerances)),
        "output": {"file": "{frame}.png", "size": list(draw(st.tuples(*[st.integers(1, 24)] * 2)))},
    }
    more = maybe(
        shading=maybe(light=DIRECTION, ambient=PART, diffuse=PART),
        pyramid=maybe(average=one_of("extinction", "opacity"), precision=one_of("half", "single")),
        splat=st.one_of(splats, st.just({"footprint": "integrated"})),
        overlay=one_of("none", "octree", "bounds"),
    )
    return scene | draw(more)


@settings(max_examples=150, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck))
@given(tree=scenes())
def test_any_scene_gives_a_picture_or_an_error(
    rasterizer_for: Callable[[Scene], Rasterizer], tree: dict[str, Any]
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            scene = parse_scene(tree, base=Path())
            stage = prepare_stage(scene, clock=lambda: 0.0, num_threads=1)
        except InputError:
            return
        brightest = scene.shading.ambient + scene.shading.diffuse if scene.shading else 1
        for frame in render_frames(stage, range(scene.camera.path.frames), rasterizer_for(scene), clock=lambda: 0.0):
            assert np.isfinite(frame.radiance).all()
            assert frame.radiance.min() >= -ROUNDING
            assert frame.radiance[..., 3].max() <= 1 + ROUNDING
            assert frame.radiance.max() <= max(1, brightest) + ROUNDING
