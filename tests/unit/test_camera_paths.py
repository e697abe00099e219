"""Camera paths: the formulas of the conventions, and that paths do not roll, jump or repeat a frame."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st
from splatting import camera_pose

from renderer.scene import CameraSpec, Keyframe, KeyframePath, RockerPath, TurntablePath
from renderer.view import camera_poses, make_view

# Sines, cosines and a 3 x 3 product of float64: a few units in the last place.
EXACT = 1e-14


def angles_of(pose: Any) -> tuple[float, float]:
    """Azimuth and elevation in degrees of a pose about +z, from `right`, which also knows them at the poles."""
    azimuth = math.degrees(math.atan2(pose.right[1], pose.right[0]))
    return azimuth, math.degrees(math.asin(max(-1.0, min(1.0, pose.direction[2]))))


def assert_orthonormal(pose: Any) -> None:
    frame = np.array([pose.right, pose.up, pose.direction])
    np.testing.assert_allclose(frame @ frame.T, np.eye(3), atol=EXACT)
    np.testing.assert_allclose(np.cross(pose.right, pose.up), pose.direction, atol=EXACT)


def keyed(*keys: tuple[int, float, float], frames: int = 120, **options: object) -> KeyframePath:
    return KeyframePath(frames, tuple(Keyframe(*key) for key in keys), **options)  # type: ignore[arg-type]


def test_turntable_is_the_formula_of_the_conventions() -> None:
    path = TurntablePath(frames=120, start=10.0, elevation=20.0)
    for frame in (0, 1, 59, 119):
        a, e = math.radians(10.0 + 3.0 * frame), math.radians(20.0)
        expected = [math.cos(e) * math.sin(a), -math.cos(e) * math.cos(a), math.sin(e)]
        np.testing.assert_allclose(camera_pose(path, frame).direction, expected, atol=EXACT)


@given(
    st.floats(-720, 720),
    st.floats(-90, 90) | st.sampled_from([-90.0, 90.0]),
    st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda axis: math.hypot(*axis) > 1e-6),
)
def test_every_pose_is_a_right_handed_frame(azimuth: float, elevation: float, axis: tuple[float, float, float]) -> None:
    pose = camera_pose(TurntablePath(1, azimuth, elevation, axis), 0)
    assert_orthonormal(pose)
    # Elevation is measured from the plane across the axis, and `right` lies in that plane: the picture does not roll.
    unit = np.array(axis) / math.hypot(*axis)
    assert pose.direction @ unit == pytest.approx(math.sin(math.radians(elevation)), abs=EXACT)
    assert pose.right @ unit == pytest.approx(0.0, abs=EXACT)


@pytest.mark.parametrize("axis", [(0.0, 3.0, 0.0), (-2.0, 0.0, 0.0), (1.0, 1.0, 1.0), (0.3, -0.2, -5.0)])
def test_another_axis_is_reached_by_the_smallest_rotation(axis: tuple[float, float, float]) -> None:
    about_z, about_axis = (camera_pose(TurntablePath(1, 25.0, 40.0, a), 0) for a in ((0.0, 0.0, 1.0), axis))
    columns = [np.array([pose.right, pose.up, pose.direction]) for pose in (about_z, about_axis)]
    rotation = columns[1].T @ columns[0]
    unit = np.array(axis) / math.hypot(*axis)
    np.testing.assert_allclose(rotation @ [0, 0, 1], unit, atol=EXACT)
    # The smallest rotation turns about the normal of the plane of both axes, so it leaves that normal alone.
    normal = np.cross([0, 0, 1], unit)
    np.testing.assert_allclose(rotation @ normal, normal, atol=EXACT)


@pytest.mark.parametrize("azimuth", [-450.0, -180.0, 0.0, 270.0, 36000.0 + 90.0])
@pytest.mark.parametrize("elevation", [-90.0, 0.0, 90.0])
def test_along_an_axis_it_is_along_an_axis(azimuth: float, elevation: float) -> None:
    """Exactly: a cosine of 1e-16 would have rays cross the planes that the eye is in, behind what is ordered before."""
    pose = camera_pose(TurntablePath(1, start=azimuth, elevation=elevation), 0)
    for axis in (pose.right, pose.up, pose.direction):
        assert sorted(np.abs(axis).tolist()) == [0.0, 0.0, 1.0]


def test_about_the_opposite_axis_everything_is_turned_half_about_x() -> None:
    pose = camera_pose(TurntablePath(1, 0.0, 0.0, (0.0, 0.0, -1.0)), 0)
    np.testing.assert_allclose(pose.direction, [0, 1, 0], atol=EXACT)
    np.testing.assert_allclose(pose.up, [0, 0, -1], atol=EXACT)
    assert_orthonormal(camera_pose(TurntablePath(1, 40.0, 30.0, (1e-12, -1e-9, -1.0)), 0))


def test_rocker_swings_to_both_sides_of_its_start() -> None:
    azimuths = [angles_of(camera_pose(RockerPath(8, swing=40.0, start=30.0), frame))[0] for frame in range(8)]
    side = 20.0 * math.sqrt(0.5)
    np.testing.assert_allclose(azimuths, [30, 30 + side, 50, 30 + side, 30, 30 - side, 10, 30 - side], atol=1e-12)


@pytest.mark.parametrize("easing", ["smooth", "linear"])
@pytest.mark.parametrize("loop", [True, False])
def test_keys_are_met(easing: str, loop: bool) -> None:
    path = keyed((3, -20.0, 10.0, 2.0), (50, 70.0, -30.0, 0.5), (90, 100.0, 60.0, 1.0), easing=easing, loop=loop)
    for key in path.keys:
        pose = camera_pose(path, key.frame)
        np.testing.assert_allclose(angles_of(pose), [key.azimuth, key.elevation], atol=1e-12)
        assert pose.zoom == pytest.approx(key.zoom, rel=EXACT)


@pytest.mark.parametrize("easing", ["smooth", "linear"])
def test_keys_around_the_axis_are_a_turntable(easing: str) -> None:
    turntable = TurntablePath(frames=120, elevation=20.0)
    for keys in ([(0, 0.0, 20.0), (40, 120.0, 20.0), (80, 240.0, 20.0)], [(0, 0.0, 20.0), (60, 180.0, 20.0)]):
        for frame in (0, 10, 77, 119):
            expected, found = (camera_pose(path, frame) for path in (turntable, keyed(*keys, easing=easing)))
            np.testing.assert_allclose(found.direction, expected.direction, atol=EXACT)


def test_smooth_easing_has_no_jump_in_velocity() -> None:
    keys = ((500, 0.0, 10.0), (1500, 90.0, 20.0), (3000, 120.0, -50.0), (4000, 100.0, 0.0))

    def largest_acceleration(easing: str, loop: bool) -> float:
        path = keyed(*keys, frames=5000, loop=loop, easing=easing)
        frames = [frame % 5000 for frame in range(5002)] if loop else range(5000)
        return float(np.abs(np.diff(camera_poses(path, frames).direction, n=2, axis=0)).max())

    for loop in (True, False):
        # A corner is a change of velocity within one frame: here 90 degrees in 1000 frames, 1.6e-3 a frame. Without
        # one, some three times that change is spread over the 1000 frames.
        assert largest_acceleration("linear", loop) > 1e-3
        assert largest_acceleration("smooth", loop) < 2e-5


def test_smooth_easing_never_leaves_the_range_of_its_two_keys() -> None:
    path = keyed((0, 0.0, 85.0), (10, 5.0, 90.0), (100, 60.0, -90.0), (110, 61.0, -90.0))
    elevations = [angles_of(camera_pose(path, frame))[1] for frame in range(120)]
    assert min(elevations) >= -90.0
    assert max(elevations) <= 90.0
    assert np.all(np.diff(elevations[10:101]) < 1e-6)  # asin near a pole has half the digits
    np.testing.assert_allclose(elevations[100:111], -90.0, atol=1e-5)


def test_a_path_that_does_not_loop_starts_and_ends_at_rest_and_holds() -> None:
    path = keyed((20, 0.0, 0.0), (100, 80.0, 0.0), loop=False)
    azimuths = np.array([angles_of(camera_pose(path, frame))[0] for frame in range(120)])
    np.testing.assert_allclose(azimuths[:21], 0.0, atol=1e-12)
    np.testing.assert_allclose(azimuths[100:], 80.0, atol=1e-12)
    assert azimuths[60] == pytest.approx(40.0)
    speeds = np.diff(azimuths[20:101])
    assert speeds[0] < 0.05 * speeds.max()
    assert speeds[-1] < 0.05 * speeds.max()


def test_a_loop_goes_the_short_way_home() -> None:
    """Forth and back, across zero, and half a turn backwards."""
    for first, second, at_90 in ((350.0, 390.0, 10.0), (20.0, 300.0, -20.0), (0.0, -180.0, 90.0)):
        path = keyed((0, first, 0.0), (60, second, 0.0), easing="linear")
        assert angles_of(camera_pose(path, 90))[0] == pytest.approx(at_90)


def test_zoom_is_interpolated_in_its_logarithm() -> None:
    path = keyed((0, 0.0, 0.0, 0.5), (100, 0.0, 0.0, 8.0), loop=False, easing="linear")
    assert [camera_pose(path, frame).zoom for frame in (25, 50, 75)] == pytest.approx([1.0, 2.0, 4.0], rel=EXACT)


def landing(view_of: CameraSpec, point: np.ndarray, distance: float, size: tuple[int, int]) -> tuple[float, float]:
    """Column and row in pixels at which a world point lands, by the definition in View."""
    view = make_view(view_of, 0, (1.0, 2.0, 3.0), distance, size)
    x, y, z = view.view_from_world(point)
    w = -z if view.projection == "perspective" else 1.0
    return size[0] / 2 + view.scale_px * x / w, size[1] / 2 - view.scale_px * y / w


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_the_frame_shows_two_distances_times_the_tangent_of_half_the_field_of_view(projection: str) -> None:
    camera = CameraSpec(TurntablePath(1, 25.0, 35.0), projection=projection, field_of_view=40.0)  # type: ignore[arg-type]
    pose, target, distance = camera_pose(camera.path, 0), np.array([1.0, 2.0, 3.0]), 10.0
    half_height = distance * math.tan(math.radians(20.0))
    assert landing(camera, target, distance, (300, 200)) == pytest.approx((150.0, 100.0))
    assert landing(camera, target + half_height * pose.up, distance, (300, 200)) == pytest.approx((150.0, 0.0))
    assert landing(camera, target + half_height * pose.right, distance, (300, 200)) == pytest.approx((250.0, 100.0))


def test_view_has_its_eye_at_the_distance_and_carries_zoom_and_near() -> None:
    path = KeyframePath(1, (Keyframe(0, 10.0, 20.0, zoom=3.0),))
    view = make_view(CameraSpec(path, near=2.5, field_of_view=90.0), 0, (1.0, 2.0, 3.0), 10.0, (64, 48))
    np.testing.assert_allclose(view.eye, [1, 2, 3] + 10.0 * camera_pose(path, 0).direction, atol=1e-13)
    np.testing.assert_allclose(view.forward, -camera_pose(path, 0).direction, atol=EXACT)
    assert view.scale_px == pytest.approx(3.0 * 24.0)
    assert (view.near, view.size, view.projection) == (2.5, (64, 48), "perspective")
