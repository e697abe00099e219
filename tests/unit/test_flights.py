"""Flights and paths of several pieces: where the camera is at each frame."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from renderer.scene import (
    CameraSpec,
    FlightKey,
    FlightPath,
    HoldPath,
    Keyframe,
    KeyframePath,
    PathPiece,
    PathSequence,
    RockerPath,
    TurntablePath,
)
from renderer.view import View, fit_distance, make_view

TARGET, DISTANCE, SIZE = (1.0, 2.0, 3.0), 10.0, (64, 48)
KEYS = (
    FlightKey((0.0, -9.0, 0.0), (0.0, 0.0, 0.0)),
    FlightKey((4.0, -2.0, 1.0), (4.0, 9.0, 0.0), 30.0),
    FlightKey((-3.0, 6.0, 2.0), (4.0, 9.0, 0.0)),
)


def views(path: PathPiece | PathSequence, **options: Any) -> list[View]:
    camera = CameraSpec(path, **options)
    return [make_view(camera, frame, TARGET, DISTANCE, SIZE) for frame in range(camera.num_frames)]


def eyes(path: PathPiece | PathSequence) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.array([view.eye for view in views(path)])


def test_a_flight_meets_its_keys_at_their_frames() -> None:
    frames = (0, 12, 60)
    keys = tuple(FlightKey(key.position, key.target, key.roll, at) for key, at in zip(KEYS, frames, strict=True))
    for easing in ("linear", "smooth"):
        found = views(FlightPath(61, keys, easing))
        for key in keys:
            view = found[key.frame or 0]
            np.testing.assert_allclose((view.eye, view.target), (key.position, key.target), atol=1e-12)
            np.testing.assert_allclose(view.axes @ view.axes.T, np.eye(3), atol=1e-12)


def test_the_eye_flies_at_a_constant_speed() -> None:
    """Chords of a curve are shorter than its arcs by less than a thousandth here."""
    steps = np.linalg.norm(np.diff(eyes(FlightPath(400, KEYS)), axis=0), axis=1)
    np.testing.assert_allclose(steps, steps.mean(), rtol=1e-3)
    eased = np.linalg.norm(np.diff(eyes(FlightPath(400, KEYS, "smooth")), axis=0), axis=1)
    assert max(eased[0], eased[-1]) < 0.02 * eased.max()
    assert eased.sum() == pytest.approx(steps.sum(), rel=1e-4)


def test_a_flight_between_two_keys_is_straight() -> None:
    found = eyes(FlightPath(11, KEYS[:2]))
    expected = np.linspace(KEYS[0].position, KEYS[1].position, 11)
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_an_eye_that_stays_turns_evenly() -> None:
    here = (0.0, 0.0, 0.0)
    path = FlightPath(11, (FlightKey(here, (0.0, 5.0, 0.0)), FlightKey(here, (4.0, 5.0, 0.0))))
    targets = np.array([view.target for view in views(path)])
    np.testing.assert_allclose(targets, np.linspace((0, 5, 0), (4, 5, 0), 11), atol=1e-12)


def test_roll_turns_the_picture_clockwise() -> None:
    """The top of the image is at its right after 90 degrees."""
    level, rolled = (
        views(FlightPath(1, (FlightKey((0.0, -9.0, 0.0), (0.0, 0.0, 0.0), roll),)))[0] for roll in (0.0, 90.0)
    )
    np.testing.assert_allclose(level.view_from_world(np.array([0.0, 0.0, 1.0]))[:2], (0, 1), atol=1e-12)
    np.testing.assert_allclose(rolled.view_from_world(np.array([0.0, 0.0, 1.0]))[:2], (1, 0), atol=1e-12)


def test_along_its_axis_a_flight_has_a_picture() -> None:
    (view,) = views(FlightPath(1, (FlightKey((0.0, 0.0, 5.0), (0.0, 0.0, 0.0)),)))
    np.testing.assert_allclose(view.axes @ view.axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(view.axes) == pytest.approx(1)


BEFORE: list[PathPiece] = [
    TurntablePath(7, 20.0, 15.0),
    RockerPath(7, start=40.0),
    KeyframePath(7, (Keyframe(0, 0.0, 10.0), Keyframe(6, 50.0, 20.0, 2.0)), loop=False),
    FlightPath(7, KEYS),
]


@pytest.mark.parametrize("before", BEFORE, ids=lambda path: path.type)
def test_pieces_begin_where_the_one_before_ended(before: PathPiece) -> None:
    """At the frame after the last of a piece: the first of the next loop, or where it came to rest."""
    path = PathSequence((before, HoldPath(3), FlightPath(20, KEYS[1:])))
    found = views(path)
    alone = views(before)
    end = alone[0] if isinstance(before, (TurntablePath, RockerPath)) else alone[-1]
    assert path.frames == len(found) == 30
    for view, expected in [*zip(found[:7], alone, strict=True), (found[7], end), (found[9], end), (found[10], end)]:
        np.testing.assert_allclose(view.axes, expected.axes, atol=1e-12)
        np.testing.assert_allclose(view.eye, expected.eye, atol=1e-9)
        assert view.scale_px == pytest.approx(expected.scale_px)
    np.testing.assert_allclose(found[-1].eye, KEYS[-1].position, atol=1e-12)
    assert found[-1].scale_px == pytest.approx(views(FlightPath(1, KEYS))[0].scale_px)


def test_a_hold_before_everything_is_where_it_begins() -> None:
    found = views(PathSequence((HoldPath(2), FlightPath(9, KEYS))))
    assert {tuple(view.eye) for view in found[:3]} == {KEYS[0].position}


def test_a_key_at_frame_0_is_a_jump() -> None:
    keys = (FlightKey(KEYS[0].position, KEYS[0].target, frame=0), FlightKey(KEYS[2].position, KEYS[2].target, frame=8))
    found = views(PathSequence((TurntablePath(4), FlightPath(9, keys))))
    np.testing.assert_allclose(found[4].eye, KEYS[0].position, atol=1e-12)


def test_to_and_fro() -> None:
    path = FlightPath(5, KEYS)
    camera = CameraSpec(path, loop="ping-pong")
    assert camera.num_frames == 8
    assert [camera.path_frame(frame) for frame in range(8)] == [0, 1, 2, 3, 4, 3, 2, 1]
    assert CameraSpec(TurntablePath(2), loop="ping-pong").num_frames == 2
    np.testing.assert_array_equal(views(path, loop="ping-pong")[6].eye, views(path)[2].eye)


def test_flights_do_not_frame_what_they_see() -> None:
    points = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    turn = TurntablePath(12, elevation=20.0)
    alone = fit_distance(CameraSpec(turn), points, (0.0, 0.0, 0.0), SIZE)
    both = fit_distance(CameraSpec(PathSequence((turn, FlightPath(9, KEYS)))), points, (0.0, 0.0, 0.0), SIZE)
    assert both == alone
    assert math.isfinite(fit_distance(CameraSpec(FlightPath(9, KEYS)), points, (0.0, 0.0, 0.0), SIZE))
