"""Evaluate camera paths: find the pose of the camera at each frame, and its View.

About the default axis +z, azimuth a and elevation e put the eye at `target + distance * direction` with

    direction = (cos e sin a, -cos e cos a, sin e)
    right     = (cos a, sin a, 0)
    up        = (-sin e sin a, sin e cos a, cos e)

These axes are right-handed at every elevation, the poles included. For another axis, all three are rotated by the
smallest rotation that takes +z to that axis; for -z by half a turn about x.

Between keyframes, azimuth, elevation and the logarithm of the zoom are interpolated separately. The eye stays on its
sphere, the picture does not roll about the axis, keys of one elevation make a turntable, and azimuths 0 and 360 make a
full turn. A great circle would keep the eye on its sphere, but rise between two keys of one elevation. Easing is
defined in `renderer.scene.motion`. A path that does not loop starts and ends at rest.

On a flight, eye and target move freely. On all other paths, the eye moves about the target of the film.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from renderer.errors import InputError
from renderer.scene import (
    CameraPath,
    CameraSpec,
    FlightPath,
    HoldPath,
    KeyframePath,
    Motion,
    PathPiece,
    PathSequence,
    TurntablePath,
    Vector,
)
from renderer.view.camera import View
from renderer.view.flights import EYE, LOG_ZOOM, ROLL, TARGET, fly
from renderer.volume import Bools, Float64

# The target of a film's camera, and the distance of the eye from the target.
About = tuple[Vector, float]
# A target and a distance for callers that only use the directions of poses.
ANYWHERE: About = (0.0, 0.0, 0.0), 1.0
# A flight looks along its axis, so that no direction is up, if the sine of the angle between them is at most this. The
# picture is then turned as at azimuth 0.
_LEAST_SINE = 1e-9
# The number of frames whose poses are computed at once, which bounds the memory of the poses.
_FRAMES_PER_CHUNK = 1 << 16


class CameraPoses(NamedTuple):
    """The poses of a camera at n frames: its orthonormal right-handed axes in the world, and its place.

    direction, right, up: the axes, float64 [n, 3]; `direction` points from the target to the eye.
    zoom: the magnification, > 0, float64 [n].
    is_free: whether a frame belongs to a flight, bool [n].
    target: the position that the eye looks at, float64 [n, 3].
    distance: the distance of the eye from the target, float64 [n].
    """

    direction: Float64
    right: Float64
    up: Float64
    zoom: Float64
    is_free: Bools
    target: Float64
    distance: Float64

    @property
    def axes(self) -> Float64:
        """Return the camera's axes at each frame, float64 [n, 3, 3]: rows are right, up and backward, as in `View`."""
        return np.stack([self.right, self.up, self.direction], axis=1)

    def rows(self, which: Any) -> CameraPoses:
        """Return the poses at some of the frames. which: a numpy index of the frames."""
        parts: Any = (each[which] for each in self)
        return CameraPoses(*parts)


def camera_poses(path: CameraPath, frames: Sequence[int], about: About = ANYWHERE) -> CameraPoses:
    """Return the poses of the camera at frames of a path. On a loop, frame `path.frames` is frame 0 again.

    about: the target of the film, and the distance of the eye from it.
    """
    pieces = path.pieces if isinstance(path, PathSequence) else (path,)
    ends, at = np.cumsum([piece.frames for piece in pieces]), np.asarray(frames, np.float64)
    numbers = np.minimum(np.searchsorted(ends, at, side="right"), len(pieces) - 1)
    found = [
        _piece_poses(pieces, k, at[numbers == k] - (ends[k] - pieces[k].frames), about) for k in np.unique(numbers)
    ]
    return CameraPoses(*map(np.concatenate, zip(*found, strict=True)))


def _piece_poses(pieces: Sequence[PathPiece], number: int, at: Float64, about: About) -> CameraPoses:
    """Return the poses of the camera on one piece of a path. Flights and holds may begin at the end of another piece.

    number: the index of the piece. at: the frames, counted from the start of the piece, [n]. about: the target of the
    film, and the distance of the eye from it.
    """
    path = pieces[number]
    if isinstance(path, (FlightPath, HoldPath)):
        others = [k for k, each in enumerate(pieces) if not isinstance(each, HoldPath)]
        stops = [(k, pieces[k].frames) for k in others if k < number][-1:]
        if isinstance(path, HoldPath) and not stops:  # a hold at the start stays where the next piece begins
            stops = [(k, 0) for k in others[:1]]
        ends = [_piece_poses(pieces, k, np.full(1, float(frame)), about) for k, frame in stops]
        if isinstance(path, FlightPath):
            return _flight_poses(path, ends[0] if ends else None, at)
        if ends:
            return ends[0].rows(np.zeros(len(at), np.int64))
        path, at = TurntablePath(path.frames), np.zeros_like(at)
    if isinstance(path, KeyframePath):
        azimuth, elevation, zoom = _interpolate_keyframes(path, at)
    else:
        if isinstance(path, TurntablePath):
            azimuth = path.start + 360.0 * at / path.frames
        else:
            azimuth = path.start + 0.5 * path.swing * np.sin(2.0 * math.pi * at / path.frames)
        elevation, zoom = np.full_like(at, path.elevation), np.ones_like(at)
    (sin_a, cos_a), (sin_e, cos_e) = _sine_and_cosine(azimuth), _sine_and_cosine(elevation)
    rotation_t = rotation_from_z_to(path.axis).T
    return CameraPoses(
        direction=np.column_stack([cos_e * sin_a, -cos_e * cos_a, sin_e]) @ rotation_t,
        right=np.column_stack([cos_a, sin_a, np.zeros_like(cos_a)]) @ rotation_t,
        up=np.column_stack([-sin_e * sin_a, sin_e * cos_a, cos_e]) @ rotation_t,
        zoom=zoom,
        is_free=np.zeros(len(at), np.bool_),
        target=np.full((len(at), 3), about[0], np.float64),
        distance=np.full(len(at), about[1], np.float64),
    )


def _flight_poses(path: FlightPath, end: CameraPoses | None, at: Float64) -> CameraPoses:
    """Return the poses of the camera on a flight: upright about the flight's axis, then turned by its roll.

    end: the last pose of the piece of the path before the flight, None without such a piece. at: the frames, counted
    from the start of the flight, [n].
    """
    start = None
    if end is not None:
        eye = end.target + end.distance[:, None] * end.direction
        start = np.concatenate([eye[0], end.target[0], [0.0], np.log(end.zoom)])
    places = fly(path, start, at)
    offset = places[:, EYE] - places[:, TARGET]
    distance = np.linalg.norm(offset, axis=1)
    if not distance.all():
        got = f"frame {at[distance == 0.0][0]:g} of a flight"
        raise InputError("the eye is at the place that it looks at", where="camera.path", got=got)
    direction = offset / distance[:, None]
    right = np.cross(np.array(path.axis) / np.linalg.norm(path.axis), direction)
    length = np.linalg.norm(right, axis=1, keepdims=True)
    aside = rotation_from_z_to(path.axis)[:, 0]  # the right side at azimuth 0, for a view along the axis
    right = np.where(length > _LEAST_SINE, right / np.maximum(length, _LEAST_SINE), aside)
    up = np.cross(direction, right)
    sine, cosine = (each[:, None] for each in _sine_and_cosine(places[:, ROLL]))
    right, up = cosine * right + sine * up, cosine * up - sine * right
    is_free = np.ones(len(at), np.bool_)
    return CameraPoses(direction, right, up, np.exp(places[:, LOG_ZOOM]), is_free, places[:, TARGET], distance)


def _sine_and_cosine(degrees: Float64) -> tuple[Float64, Float64]:
    """Return the sines and cosines of angles in degrees, [n], with exact values at multiples of 90 degrees.

    So rays along an axis are exactly parallel to the faces of the volume along the axis. An angle and the angle after
    many full turns have exactly the same values.
    """
    right_angles = np.rint(degrees / 90.0)
    rest = np.radians(np.fmod(degrees, 360.0) - 90.0 * np.fmod(right_angles, 4.0))
    sine, cosine, quarter = np.sin(rest), np.cos(rest), np.mod(right_angles, 4.0)
    return (
        np.choose(quarter.astype(np.int64), [sine, cosine, -sine, -cosine]),
        np.choose(quarter.astype(np.int64), [cosine, -sine, -cosine, sine]),
    )


def iter_camera_poses(path: CameraPath, about: About = ANYWHERE) -> Iterator[CameraPoses]:
    """Yield the poses of all frames of a path, in chunks of bounded size that overlap by one frame.

    about: the target of the film, and the distance of the eye from it.
    """
    for first in range(0, max(path.frames - 1, 1), _FRAMES_PER_CHUNK):
        yield camera_poses(path, range(first, min(first + _FRAMES_PER_CHUNK + 1, path.frames)), about)


def make_view(camera: CameraSpec, frame: int, target: Vector, distance: float, size: tuple[int, int]) -> View:
    """Return the View of a frame: the eye is at `target + distance * direction` in the world, unless it is on a flight.

    scale_px is (height / 2) / tan(field of view / 2) in perspective. In orthographic projection,
    2 distance tan(field of view / 2) world units fill the height. Zoom multiplies scale_px: it magnifies and does not
    move the eye. Raises InputError if the distance is not positive.
    """
    if not (distance > 0.0 and math.isfinite(distance)):
        raise InputError(
            "the eye is not at a finite distance from the target",
            where="camera.distance",
            got=f"{distance:g}",
            expected="a length greater than 0",
        )
    poses = camera_poses(camera.path, [camera.path_frame(frame)], (target, distance))
    axes, centre, distance = poses.axes[0], poses.target[0].copy(), float(poses.distance[0])
    axes.flags.writeable = centre.flags.writeable = False
    scale_px = focal_length_px(camera, size) * float(poses.zoom[0])
    if camera.projection == "orthographic":
        scale_px /= distance
    return View(axes, centre, distance, camera.projection, scale_px, size, camera.near, camera.shift or (0.0, 0.0))


def focal_length_px(camera: CameraSpec, size: tuple[int, int]) -> float:
    """Return the focal length in pixels: how many pixels a length of 1 at a depth of 1 has, without zoom."""
    return size[1] / 2 / math.tan(math.radians(camera.field_of_view) / 2)


def rotation_from_z_to(axis: Vector) -> Float64:
    """Return the matrix of the smallest rotation of +z onto an axis, float64 [3, 3]. axis: a vector of any length."""
    length = math.hypot(*axis)
    x, y, z = (component / length for component in axis)
    aside = x * x + y * y
    if aside < 1e-300:  # the axis is +z or -z to all digits, and 2 / aside may be infinite
        return np.diag([1.0, 1.0, 1.0]) if z > 0.0 else np.diag([1.0, -1.0, -1.0])
    # Both formulas are 1 / (1 + z); the second formula avoids cancellation for axes near -z.
    factor = 1.0 / (1.0 + z) if z > 0.0 else (1.0 - z) / aside
    return np.array(
        [
            [1.0 - x * x * factor, -x * y * factor, x],
            [-x * y * factor, 1.0 - y * y * factor, y],
            [-x, -y, z],
        ]
    )


def _interpolate_keyframes(path: KeyframePath, at: Float64) -> tuple[Float64, Float64, Float64]:
    """Return azimuth and elevation in degrees, and zoom, at frames of a path with keys, float64 [n] each.

    at: the frames, counted from the start of the path, [n].
    """
    if len(path.keys) == 1:
        (key,) = path.keys
        azimuth, elevation, zoom = (np.full_like(at, value) for value in (key.azimuth, key.elevation, key.zoom))
        return azimuth, elevation, zoom
    frames = tuple(key.frame for key in path.keys)
    rows: tuple[tuple[float, ...], ...]
    rows = tuple((key.azimuth, key.elevation, math.log(key.zoom)) for key in path.keys)
    if path.loop:
        frames, rows = (*frames, frames[0] + path.frames), (*rows, _first_again(rows))
        at = np.where(at < frames[0], at + path.frames, at)
    motion = Motion(frames, rows, path.easing, is_closed=path.loop)
    azimuth, elevation, log_zoom = np.array([motion.at(frame) for frame in at.tolist()]).T
    return azimuth, elevation, np.exp(log_zoom)


def _first_again(rows: Sequence[tuple[float, ...]]) -> tuple[float, ...]:
    """Return the key that closes a loop: the first key, with whole turns added to its azimuth.

    The turns make the way from the last key to this key shortest. rows: the azimuth, the elevation and the logarithm of
    the zoom of each key.
    """
    first, last, previous = rows[0], rows[-1], rows[-2]
    way = (first[0] - last[0]) % 360.0
    if way > 180.0 or (way == 180.0 and last[0] < previous[0]):  # a half turn continues in the direction of the path
        way -= 360.0
    return last[0] + way, *first[1:]
