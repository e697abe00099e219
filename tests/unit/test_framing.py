"""Automatic framing: everything inside, nothing to spare, at every frame of every kind of path."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from film_stages import PLAIN, stage_of

import renderer
from renderer.frame import Stage
from renderer.pyramid import build_pyramid
from renderer.scene import (
    AnnotationSpec,
    CameraPath,
    CameraSpec,
    ControlPoint,
    ErrorSpec,
    Keyframe,
    KeyframePath,
    PyramidSpec,
    RockerPath,
    SplatSpec,
    TransferSpec,
    TurntablePath,
    Vector,
)
from renderer.transfer import TransferFunction
from renderer.view import camera_poses, fit_distance, make_view, smallest_voxel_px, visible_centre, visible_points
from renderer.volume import Float64, Volume, make_volume

# The share of half the picture that framing leaves free.
MARGIN = 0.03

PATHS: list[CameraPath] = [
    TurntablePath(12, start=7.0, elevation=20.0),
    RockerPath(9, swing=90.0, elevation=-70.0, axis=(1.0, 2.0, 0.5)),
    KeyframePath(10, (Keyframe(0, 0.0, 80.0), Keyframe(4, 200.0, -10.0), Keyframe(7, 220.0, 90.0))),
]


def cloud(rng: np.random.Generator, shape: int) -> Float64:
    """A flat, a long or a round cloud, some way from the target."""
    scales = np.array([[1.0, 1.0, 0.01], [0.05, 0.05, 3.0], [1.0, 1.0, 1.0]])[shape]
    return rng.normal(size=(200, 3)) * scales + rng.normal(size=3)


def excess(camera: CameraSpec, points: Float64, target: Vector, distance: float, size: tuple[int, int]) -> float:
    """How far the worst point lies outside its limit, as a share of it: side by side in the frame, or before `near`."""
    width, height = size
    margin = MARGIN * min(size) / 2
    worst = -np.inf
    for frame in range(camera.path.frames):
        view = make_view(camera, frame, target, distance, size)
        x, y, z = view.view_from_world(points).T
        w = -z if view.projection == "perspective" else np.ones_like(z)
        sides = [
            np.abs(x) * view.scale_px - (width / 2 - margin) * w,
            np.abs(y) * view.scale_px - (height / 2 - margin) * w,
        ]
        worst = max(worst, *(float((side / (view.scale_px * distance)).max()) for side in sides))
        worst = max(worst, float((camera.near + z).max()) / distance)
    return worst


@pytest.mark.parametrize("fov", [0.01, 30.0, 179.0])
@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_all_points_are_inside_and_the_frame_is_full(projection: str, fov: float) -> None:
    rng = np.random.default_rng(5)
    cases = itertools.product(PATHS, range(3), [(1920, 200), (30, 500)], [0.0, 2.0])
    for path, shape, size, near in cases:
        points = cloud(rng, shape)
        target = visible_centre(points) if shape else (0.1, 0.2, -0.3)
        camera = CameraSpec(path, projection=projection, field_of_view=fov, near=near)  # type: ignore[arg-type]
        distance = fit_distance(camera, points, target, size)
        # The sums behind one coordinate round to some 1e-16 of the distance, which a narrow view makes 1e4 clouds wide.
        assert excess(camera, points, target, distance, size) < 1e-12
        assert excess(camera, points, target, 0.999 * distance, size) > 0.0


def test_zoom_magnifies_a_fitted_frame_and_a_large_cloud_is_framed_in_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    points = np.random.default_rng(1).normal(size=(500, 3))
    assert visible_centre(points) == pytest.approx((points.min(axis=0) + points.max(axis=0)) / 2)
    arguments = (points, (0.0, 0.0, 0.0), (64, 48))
    plain, zoomed = (CameraSpec(KeyframePath(1, (Keyframe(0, 0.0, 0.0, zoom),))) for zoom in (1.0, 2.0))
    whole = fit_distance(plain, *arguments)
    assert fit_distance(zoomed, *arguments) == whole
    monkeypatch.setattr("renderer.view.framing._MAX_PRODUCTS", 10)
    assert fit_distance(plain, *arguments) == pytest.approx(whole, rel=1e-15)


@pytest.mark.parametrize("shape", range(3))
def test_long_paths_are_framed_exactly(shape: int) -> None:
    """Points that are left out in runs of like directions decide nothing: all points on all frames give the same."""
    points = cloud(np.random.default_rng(3), shape)[:60]
    for path in (
        TurntablePath(5000, elevation=20.0),
        KeyframePath(3000, (Keyframe(0, 0.0, -80.0), Keyframe(2999, 1000.0, 80.0)), loop=False),
    ):
        camera, poses = CameraSpec(path, field_of_view=40.0), camera_poses(path, range(path.frames))
        half = (1 - MARGIN) * math.tan(math.radians(20.0))
        sides = [poses.direction + sign * side / half for side in (poses.right, poses.up) for sign in (1, -1)]
        expected = max(float((normals @ points.T).max()) for normals in sides)
        assert fit_distance(camera, points, (0.0, 0.0, 0.0), (9, 9)) == pytest.approx(expected, rel=1e-14)


def test_with_its_outline_the_whole_volume_is_in_frame() -> None:
    values = np.zeros((16, 20, 24), np.uint8)
    values[3:6, 4:9, 5:7] = 255
    camera = replace(PLAIN.camera, target="visible")
    stage = stage_of(
        replace(PLAIN, camera=camera, annotation=AnnotationSpec(bounds=True)), make_volume(values, np.eye(4), "some")
    )
    assert stage.target == (11.5, 9.5, 7.5)
    corners = np.array(list(itertools.product([-0.5, 23.5], [-0.5, 19.5], [-0.5, 15.5])))
    arguments = corners, stage.target, PLAIN.output.size
    assert stage.distance == pytest.approx(fit_distance(camera, *arguments), rel=1e-12)


@pytest.mark.parametrize(
    ("shape", "share"), [((1, 1, 1), 0.6), ((5, 9, 14), 0.05), ((40, 3, 21), 0.6), ((17, 30, 30), 0.002)]
)
def test_the_ends_of_each_line_of_corners_stand_for_all_corners(shape: tuple[int, int, int], share: float) -> None:
    rng = np.random.default_rng(6)
    values = (rng.random(shape) < share).astype(np.uint8)
    values[tuple(rng.integers(0, shape))] = 1
    transfer = TransferFunction(np.array([0.0, 1.0]), np.ones((2, 3)), np.array([0.0, 1.0]), 1.0)
    volume = make_volume(values, np.eye(4), "random")
    pyramid = build_pyramid(volume, transfer, spec=PyramidSpec(), error=ErrorSpec())
    cells = np.argwhere(pyramid.occupied)[:, ::-1]
    corners = np.concatenate([cells + offset for offset in itertools.product((0, 1), repeat=3)])
    everything = np.minimum(corners << pyramid.occupied_level, volume.shape_xyz) - 0.5
    lines: dict[tuple[float, float], set[float]] = {}
    for x, y, z in everything.tolist():
        lines.setdefault((y, z), set()).add(x)
    points = visible_points(pyramid)
    assert sorted(points.tolist()) == sorted([x, *line] for line, xs in lines.items() for x in (min(xs), max(xs)))
    for path in PATHS:
        ends, every = (fit_distance(CameraSpec(path), p, (1.0, 2.0, 3.0), (64, 64)) for p in (points, everything))
        assert ends == pytest.approx(every, rel=1e-15)


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
@pytest.mark.parametrize("path", [*PATHS, KeyframePath(1, (Keyframe(0, 0.0, 0.0, 2.0),))], ids=range(4))
def test_how_wide_a_voxel_is(projection: str, path: CameraPath) -> None:
    """As the views of the frames have it, where it is narrowest."""
    volume = make_volume(np.zeros((4, 6, 8), np.uint8), np.diag([2.0, 1.5, 3.0, 1.0]), "")
    camera = CameraSpec(path, projection)  # type: ignore[arg-type]
    target, distance, size = (3.0, 20.0, -4.0), 90.0, (64, 48)
    widths_px = []
    for frame in range(path.frames):
        view = make_view(camera, frame, target, distance, size)
        depth = -float(view.view_from_world(volume.centre)[2]) if projection == "perspective" else 1.0
        widths_px.append(1.5 * view.scale_px / depth)
    assert smallest_voxel_px(volume, camera, target, distance, size) == pytest.approx(min(widths_px))


def test_a_voxel_is_no_wider_than_one_half_a_diagonal_from_the_eye() -> None:
    """The eye may be where it is, or beyond it."""
    volume = make_volume(np.zeros((4, 6, 8), np.uint8), np.eye(4), "")
    x, y, z = volume.centre
    from_above = CameraSpec(TurntablePath(1, elevation=90.0))
    half_diagonal = math.sqrt(4**2 + 6**2 + 8**2) / 2
    for target_z in (z - 10, z - 50):
        width_px = smallest_voxel_px(volume, from_above, (x, y, target_z), 10.0, (64, 48))
        assert width_px == pytest.approx(24 / math.tan(math.radians(15)) / half_diagonal)


def test_footprints_are_framed_alike() -> None:
    """Studies compare them by one truth, which is of one camera."""
    scene = replace(PLAIN, camera=CameraSpec(TurntablePath(4), target="visible"))
    stages = [stage_of(replace(scene, splat=SplatSpec(footprint))) for footprint in ("integrated", "gaussian")]
    assert len({(stage.target, stage.distance) for stage in stages}) == 1


@pytest.mark.parametrize("num", [2, 3, 6, 12])
def test_splats_of_a_small_volume_are_whole_in_the_frame(num: int) -> None:
    labels = np.random.default_rng(0).integers(1, 4, (num, num, num)).astype(np.uint8)
    points = ControlPoint(0.0, (1.0, 1.0, 1.0), 0.0), ControlPoint(3.0, (1.0, 1.0, 1.0), 0.9)
    scene = renderer.suggest_scene(labels, size=(48, 48))
    scene = replace(scene, splat=SplatSpec("gaussian"))
    scene = scene.with_layers(transfer_function=TransferSpec(points), shading=None)
    alpha = np.asarray(renderer.render_frame(scene, 10))[..., :3].max(axis=2)  # on black
    rim = np.concatenate([alpha[0], alpha[-1], alpha[:, 0], alpha[:, -1]])
    assert rim.max() == 0 and alpha.max() > 100
    rows, columns = np.nonzero(alpha)
    assert max(np.ptp(rows), np.ptp(columns)) > 0.4 * len(alpha)


def in_one_volume(*boxes: tuple[int, int, int]) -> Volume:
    """Return a block of 60 x 50 x 40 voxels, and single ones at places x, y, z."""
    values = np.zeros((96, 96, 96), np.uint8)
    values[10:50, 10:60, 10:70] = 200
    for x, y, z in boxes:
        values[z, y, x] = 200
    return make_volume(values, np.eye(4), "block")


def framed(volume: Volume, opacity: float = 0.9) -> Stage:
    points = (ControlPoint(0.0, (1.0, 1.0, 1.0), 0.0), ControlPoint(200.0, (1.0, 1.0, 1.0), opacity))
    camera = replace(PLAIN.camera, target="visible")
    return stage_of(replace(PLAIN, camera=camera).with_layers(transfer_function=TransferSpec(points)), volume)


def test_a_voxel_beside_an_object_does_not_decide_how_it_is_framed() -> None:
    """One of 120,000 moves nothing, and is told; a column of 60 is seen, and so decides."""
    alone, beside = framed(in_one_volume()), framed(in_one_volume((90, 90, 90)))
    assert (beside.target, beside.distance) == (alone.target, alone.distance)
    assert alone.not_framed == 0.0 < beside.not_framed < 1e-3
    wide = framed(in_one_volume(*((90, 90, z) for z in range(20, 80))))
    assert wide.distance > 1.2 * alone.distance and wide.not_framed == 0.0


def test_faint_voxels_around_an_object_do_not_decide_how_it_is_framed() -> None:
    volume = in_one_volume()
    values = volume.values.copy()
    random = np.random.default_rng(0)
    for z, y, x in random.integers(0, 96, (150, 3)).tolist():
        values[z, y, x] = max(1, int(values[z, y, x]))
    alone, beside = framed(volume), framed(make_volume(values, np.eye(4), "faint"))
    # Those within eight voxels of the block are not told from it.
    assert beside.target == pytest.approx(alone.target, abs=4)
    assert beside.distance == pytest.approx(alone.distance, rel=0.1)
    assert 0.0 < beside.not_framed < 1e-3


def test_the_tip_of_an_object_stays_in_frame() -> None:
    """A needle that adds little to the picture is a part of the object, and decides."""
    needle = framed(in_one_volume(*((x, 30, 40) for x in range(70, 74))))
    assert needle.target[0] > framed(in_one_volume()).target[0] and needle.not_framed == 0.0


def test_what_is_faint_throughout_is_framed_whole() -> None:
    assert framed(in_one_volume(), opacity=1e-4).distance == framed(in_one_volume()).distance
