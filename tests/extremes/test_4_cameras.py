"""Cameras in, on, along and far from a volume, and volumes of any size at any place."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from extremes import Extreme, Measure, Random, Section, worst_drawn, worst_of
from ray_integrals import integrate
from small_scene import small_tree
from splat_reference import rasterize_reference
from splatting import Float64, volume_of

from renderer.draw import SplatRasterizer
from renderer.errors import SceneError
from renderer.frame import Stage, prepare_stage, render_frames, view_of
from renderer.pyramid import cut_pyramid
from renderer.scene import (
    MAX_ZOOM,
    MIN_FIELD_OF_VIEW,
    CameraSpec,
    ControlPoint,
    ErrorSpec,
    Keyframe,
    KeyframePath,
    LayerSpec,
    OutputSpec,
    ProceduralSource,
    PyramidSpec,
    Scene,
    SplatSpec,
    TransferSpec,
    TurntablePath,
    Vector,
    VolumeSpec,
    parse_scene,
)
from renderer.splats import make_splats
from renderer.transfer import make_transfer_function
from renderer.view import View, make_view, visible_order
from renderer.volume import Volume

SIZE = (32, 32)
SHAPE = (4, 3, 5)  # z, y, x
RADIUS = 0.5 * math.hypot(*SHAPE)
# Half a voxel deep for a voxel of 255; colours apart, so that an order that is wrong shows.
POINTS = (ControlPoint(0.0, (0.1, 0.2, 0.9), 0.0), ControlPoint(255.0, (1.0, 0.3, 0.1), 0.4))


def random_volume(rng: Random) -> Volume:
    """Noise with holes around the world's origin, spacing 1."""
    values = rng.integers(0, 256, SHAPE, dtype=np.uint8)
    return volume_of(np.where(rng.random(SHAPE) < 0.5, values, np.uint8(0)))


def scene_of(camera: CameraSpec, unit: float = 1.0) -> Scene:
    return Scene(
        layers=(LayerSpec(VolumeSpec(ProceduralSource("constant", SHAPE)), TransferSpec(POINTS, unit)),),
        camera=camera,
        output=OutputSpec(Path("film.mp4"), SIZE),
        error=ErrorSpec(0.0),
        pyramid=PyramidSpec(precision="single"),
        splat=SplatSpec("gaussian"),
    )


def staged(camera: CameraSpec, volume: Volume, unit: float = 1.0) -> Stage:
    return prepare_stage(scene_of(camera, unit), clock=lambda: 0.0, num_threads=1, volumes=[volume])


# Splats against the float64 reference

Eyes = Callable[[Random], tuple[Vector, Float64]]  # target, and the eye relative to it


def direction(rng: Random) -> Float64:
    vector = rng.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))


def inside(rng: Random) -> Float64:
    return np.asarray((rng.random(3) - 0.5) * SHAPE[::-1])


def from_eye(eye: Float64, back: Float64) -> tuple[Vector, Float64]:
    """A camera at `eye` that looks against `back`."""
    x, y, z = (eye - back).tolist()
    return (x, y, z), back


def anywhere_inside(rng: Random) -> tuple[Vector, Float64]:
    return from_eye(inside(rng), direction(rng))


def on_a_face(rng: Random) -> tuple[Vector, Float64]:
    eye, axis = inside(rng), rng.integers(3)
    eye[axis] = math.copysign(SHAPE[2 - axis] / 2, eye[axis])
    return from_eye(eye, direction(rng))


def at_a_voxel(rng: Random) -> tuple[Vector, Float64]:
    index = rng.integers(0, SHAPE[::-1])
    return from_eye(index - (np.array(SHAPE[::-1]) - 1) / 2, direction(rng))


def along_an_axis(rng: Random) -> tuple[Vector, Float64]:
    back = np.zeros(3)
    back[rng.integers(3)] = rng.choice([-1.0, 1.0])
    return (0.0, 0.0, 0.0), back * rng.choice([0.25, 1.0, 4.0]) * RADIUS


def around(rng: Random) -> tuple[Vector, Float64]:
    return (0.0, 0.0, 0.0), direction(rng) * RADIUS * (1.0 + rng.random())


def spec_of(target: Vector, back: Float64, **lens: object) -> CameraSpec:
    """The camera at `target + back`."""
    distance = float(np.linalg.norm(back))
    x, y, z = back / distance
    azimuth, elevation = math.degrees(math.atan2(x, -y)), math.degrees(math.asin(max(-1.0, min(1.0, z))))
    path = TurntablePath(1, azimuth, elevation)
    return CameraSpec(path, target=target, distance=distance, **lens)  # type: ignore[arg-type]


def against_reference(cameras: Callable[[Random], CameraSpec]) -> Measure:
    """The worst channel of a pixel of GL's picture against the reference's of the same splats."""

    def error(gl: SplatRasterizer, rng: Random, _: int) -> float:
        stage = staged(cameras(rng), random_volume(rng))
        batch, view = make_splats(cut_pyramid(stage.layers[0].pyramid, 0.0), stage.scene.splat), view_of(stage, 0)
        order = visible_order(batch, view)
        return float(np.abs(gl.rasterize([batch], [order], view) - rasterize_reference(batch, order, view)).max())

    return worst_drawn(error)


def seen_from(eyes: Eyes, **lens: object) -> Callable[[Random], CameraSpec]:
    return lambda rng: spec_of(*eyes(rng), **lens)


def narrow(rng: Random) -> CameraSpec:
    return CameraSpec(TurntablePath(1, 360 * rng.random(), 30.0), field_of_view=0.01)


def from_the_pole(rng: Random) -> CameraSpec:
    path = TurntablePath(1, 360 * rng.random(), rng.choice([-90.0, 90.0]))
    return CameraSpec(path, projection=rng.choice(["perspective", "orthographic"]))


def from_afar(rng: Random) -> CameraSpec:
    """1e4 to 1e12 radii away, magnified until the volume fills the picture again."""
    distance = RADIUS * 10 ** rng.uniform(4, 12)
    fov, zoom = math.degrees(2 * math.atan(RADIUS / distance)), 1.0
    if fov < MIN_FIELD_OF_VIEW:
        fov, zoom = MIN_FIELD_OF_VIEW, math.tan(math.radians(MIN_FIELD_OF_VIEW) / 2) * distance / RADIUS
    path = KeyframePath(1, (Keyframe(0, 360 * rng.random(), 30.0, min(zoom, MAX_ZOOM)),))
    return CameraSpec(path, field_of_view=fov, target=(0.0, 0.0, 0.0), distance=distance)


def cut_by_near(rng: Random) -> CameraSpec:
    target, back = around(rng)
    projection = rng.choice(["perspective", "orthographic"])
    return spec_of(target, back, near=float(np.linalg.norm(back)) - rng.uniform(-0.5, 0.5), projection=projection)


# The truth against a closed form: one ray's way through a homogeneous block


def block_error(cameras: Callable[[Random], CameraSpec]) -> Measure:
    """The worst alpha of the ray integral through a block of extinction 0.5, against `1 - exp(-0.5 length)`."""
    volume = volume_of(np.full(SHAPE, 255, np.uint8))
    transfer = make_transfer_function(TransferSpec((ControlPoint(0.0, (1, 1, 1), -math.expm1(-0.5)),), 1.0), 1.0)

    def error(rng: Random, _: int) -> float:
        camera = cameras(rng)
        assert camera.distance is not None and isinstance(camera.target, tuple)
        view = make_view(camera, 0, camera.target, camera.distance, SIZE)
        image = integrate(volume, transfer, view, step_voxels=1.0, num_threads=1)
        return float(np.abs(image[..., 3] - -np.expm1(-0.5 * lengths(view))).max())

    return worst_of(error)


def about_the_block(rng: Random) -> CameraSpec:
    eyes = (anywhere_inside, on_a_face, at_a_voxel, around, along_an_axis)
    return spec_of(*eyes[rng.integers(len(eyes))](rng))


def narrow_on_the_block(rng: Random) -> CameraSpec:
    return spec_of((0.0, 0.0, 0.0), direction(rng) * RADIUS / math.tan(math.radians(0.005)), field_of_view=0.01)


def lengths(view: View) -> Float64:
    """float64 [h, w]: of each pixel's ray in the block, by its two distances to each pair of faces from the plane of
    the target, behind which the eye is."""
    width, height = view.size
    x, y = np.meshgrid(np.arange(width) + 0.5 - width / 2, height / 2 - np.arange(height) - 0.5)
    rays = np.stack([x / view.scale_px, y / view.scale_px, np.full_like(x, -1.0)], axis=-1)
    eyes = -view.distance * np.linalg.norm(rays, axis=-1)
    origins = view.target + view.distance * (rays + np.array([0.0, 0.0, 1.0])) @ view.axes
    rays = rays @ view.axes / np.linalg.norm(rays, axis=-1, keepdims=True)
    rays = np.where(rays == 0.0, 1e-200, rays)
    half = np.array(SHAPE[::-1]) / 2
    one, two = (-half - origins) / rays, (half - origins) / rays
    enter, leave = np.minimum(one, two).max(axis=-1), np.maximum(one, two).min(axis=-1)
    return np.asarray(np.maximum(leave - np.maximum(enter, eyes), 0.0))


# The same scene elsewhere and in other units


def cameras_everywhere(rng: Random) -> CameraSpec:
    """Framed, aimed or inside; in both projections."""
    path = TurntablePath(1, 360 * rng.random(), 180 * rng.random() - 90)
    camera = CameraSpec(path, rng.choice(["perspective", "orthographic"]), rng.uniform(10, 100))
    kind = rng.integers(4)
    if kind == 0:
        return camera
    if kind == 1:
        return replace(camera, target="visible")
    x, y, z = inside(rng).tolist()
    return replace(camera, target=(x, y, z), distance=RADIUS * rng.choice([0.01, 1.0, 2.0]), near=RADIUS * rng.random())


def moved(camera: CameraSpec, volume: Volume, scale: float, shift: Float64) -> tuple[CameraSpec, Volume]:
    """All lengths times `scale`, then all positions plus `shift`."""
    affine = volume.world_from_index.copy()
    affine[:3] *= scale
    affine[:3, 3] += shift
    if isinstance(camera.target, tuple):
        x, y, z = (scale * np.array(camera.target) + shift).tolist()
        camera = replace(camera, target=(x, y, z))
    distance = None if camera.distance is None else scale * camera.distance
    return replace(camera, distance=distance, near=scale * camera.near), volume_of(volume.values.copy(), affine)


Picture = npt.NDArray[np.floating]


def drawn(gl: SplatRasterizer, stage: Stage) -> Picture:
    (frame,) = render_frames(stage, [0], gl, clock=lambda: 0.0)
    return frame.radiance


def integrated(_: SplatRasterizer, stage: Stage) -> Picture:
    volume = stage.layers[0].volume
    transfer = make_transfer_function(stage.scene.layers[0].transfer_function, volume.finest_spacing)
    return integrate(volume, transfer, view_of(stage, 0), step_voxels=1.0, num_threads=1)


def difference(scales: Sequence[float], shift: float, picture: Callable[[SplatRasterizer, Stage], Picture]) -> Measure:
    """The worst channel of a pixel against the picture of the scene at the origin with voxels of 1.

    shift: the length of the shift, in voxels.
    """

    def error(gl: SplatRasterizer, rng: Random, _: int) -> float:
        camera, volume, scale = cameras_everywhere(rng), random_volume(rng), rng.choice(scales)
        stage = staged(*moved(camera, volume, scale, shift * scale * direction(rng)), unit=scale)
        return float(np.abs(picture(gl, stage) - picture(gl, staged(camera, volume))).max())

    return worst_drawn(error)


# What no camera may be

INFINITY = float("inf")
NEITHER = [1e300, -1e300, -1, float("nan"), INFINITY, -INFINITY, "far", True, None, []]
WRONG: dict[str, list[object]] = {
    "distance": [*NEITHER, 0, 1e-300, 1e20],
    "near": [*NEITHER, 1e20],
    "field_of_view": [*NEITHER, 0, 1e-300, 180, 360],
    "target": [*NEITHER, [0, 0], [0, 0, 1e300], [1e20, 0, 0], [0, float("nan"), 0]],
    "projection": [*NEITHER, "oblique"],
    "path.start": [number for number in NEITHER if number != -1],
    "path.elevation": [*(number for number in NEITHER if number != -1), 90.1, -90.1],
    "path.frames": [*NEITHER, 0, 1.5, 10**7],
    "path.axis": [*NEITHER, [0, 0, 0], [1e-320, 0, 0], [0, 0, 1e300]],
}


def accepted(_: int) -> float:
    """How many of WRONG are taken, or refused without their place."""
    return float(sum(not complains(key, value) for key, values in WRONG.items() for value in values))


def complains(key: str, value: object) -> bool:
    camera: dict[str, Any] = {"path": {"type": "turntable", "frames": 9}}
    *sections, last = key.split(".")
    (camera[sections[0]] if sections else camera)[last] = value
    try:
        parse_scene(small_tree(camera=camera), base=Path())
    except SceneError as error:
        return all(problem.path.startswith(f"camera.{key}") for problem in error.problems)
    return False


RELATIVE = "differences with the volume's centre, in float64, come first; target and distance stay apart"
TRUNCATED = "what the near plane clips becomes a Gaussian with the same moments"
CHANNEL = "channel against the float64 reference"
MOVED = "channel against that at the origin"
CLOSED, ALPHA = "rays begin beside the volume's centre", "alpha against 1 - exp(-tau length)"

SECTION = Section(
    "Cameras",
    (
        Extreme("eye inside the volume", TRUNCATED, CHANNEL, 3e-6, against_reference(seen_from(anywhere_inside))),
        Extreme("eye on a face", TRUNCATED, CHANNEL, 3e-6, against_reference(seen_from(on_a_face))),
        Extreme("eye exactly at a voxel's centre", TRUNCATED, CHANNEL, 3e-6, against_reference(seen_from(at_a_voxel))),
        Extreme("eye on an axis", RELATIVE, CHANNEL, 3e-6, against_reference(seen_from(along_an_axis))),
        Extreme("looking along the up vector", "azimuth gives the frame", CHANNEL, 3e-6,
            against_reference(from_the_pole)),
        Extreme("field of view 0.01 degrees", RELATIVE, CHANNEL, 3e-6, against_reference(narrow)),
        Extreme("field of view 179 degrees, outside", "slopes held to those of the picture", CHANNEL, 3e-6,
            against_reference(seen_from(around, field_of_view=179.0))),
        Extreme("field of view 179 degrees, inside", TRUNCATED, CHANNEL, 3e-6,
            against_reference(seen_from(anywhere_inside, field_of_view=179.0))),
        Extreme("eye up to 1e12 radii away, magnified", RELATIVE, CHANNEL, 3e-6, against_reference(from_afar)),
        Extreme("near plane through the volume", TRUNCATED, CHANNEL, 3e-6, against_reference(cut_by_near)),
        Extreme("truth: eye in, on and around a block", CLOSED, ALPHA, 1e-9, block_error(about_the_block)),
        Extreme("truth: eye up to 1e12 radii away, magnified", CLOSED, ALPHA, 1e-9, block_error(from_afar)),
        Extreme("truth: field of view 0.01 degrees", CLOSED, ALPHA, 1e-9, block_error(narrow_on_the_block)),
        Extreme("truth: field of view 179 degrees", CLOSED, ALPHA, 1e-9,
            block_error(seen_from(anywhere_inside, field_of_view=179.0))),
        Extreme("eye at the target, 1e300, NaN, text, nothing",
            "bounds for every number, alone and by the volume's size", f"accepted, of {sum(map(len, WRONG.values()))}",
            0, accepted),
        Extreme("volume 2^-30 or 2^30 wide", RELATIVE, MOVED, 0.0, difference([2.0**-30, 2.0**30], 0.0, drawn)),
        Extreme("volume 1e-9 or 1e9 wide", RELATIVE, MOVED, 1e-5, difference([1e-9, 1e9], 0.0, drawn)),
        Extreme("1e6 units away, 1e-3 wide", RELATIVE, MOVED, 1e-5, difference([1e-3 / 6], 6e9, drawn)),
        Extreme("1e9 voxels away, any size", RELATIVE, MOVED, 1e-5, difference([1e-9, 1.0, 1e9], 1e9, drawn)),
        Extreme("truth: volume 1e-9 or 1e9 wide", RELATIVE, MOVED, 1e-9, difference([1e-9, 1e9], 0.0, integrated)),
        Extreme("truth: 1e9 voxels away", RELATIVE, MOVED, 1e-5, difference([1e-9, 1.0, 1e9], 1e9, integrated)),
    ),
    notes="1e9 voxels from the origin float64 rounds coordinates by 1e-7 of a voxel, which is in the number.",
)  # fmt: skip


@pytest.mark.parametrize("extreme", SECTION.extremes, ids=str)
def test_extreme(extreme: Extreme) -> None:
    extreme.check()
