"""Evaluate camera paths: where the camera looks at each frame, and the View that follows.

About the default axis +z, azimuth a and elevation e put the eye at `target + distance * direction` with

    direction = (cos e sin a, -cos e cos a, sin e)
    right     = (cos a, sin a, 0)
    up        = (-sin e sin a, sin e cos a, cos e)

which is a right-handed frame at every elevation, the poles included. For another axis all three are rotated by the
smallest rotation that takes +z to that axis; for -z by half a turn about x.

Between keyframes azimuth, elevation and the logarithm of the zoom are interpolated separately. The eye stays on its
sphere, the picture does not roll about the axis, keys of one elevation make a turntable, and azimuths 0 and 360 make a
full turn. Great circles have only the first of these properties: between two keys of one elevation they rise above it.
`smooth` easing is the monotone piecewise cubic of F. N. Fritsch and J. Butland, "A method for constructing local
monotone piecewise cubic interpolants", SIAM J. Sci. Stat. Comput. 5 (1984): the velocity is continuous, and no value
lies beyond its two keys. A path that does not loop starts and ends at rest.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from renderer.errors import InputError
from renderer.scene import CameraPath, CameraSpec, KeyframePath, TurntablePath, Vector
from renderer.view.camera import View
from renderer.volume import Float64

# Bounds the memory of poses.
_FRAMES_PER_CHUNK = 1 << 16


@dataclass(frozen=True)
class CameraPoses:
    """A camera at n frames, up to its distance: orthonormal right-handed frames (right, up, direction) in the world.

    direction, right, up: float64 [n, 3]; `direction` points from the target to the eye. zoom: float64 [n],
    magnifications, > 0.
    """

    direction: Float64
    right: Float64
    up: Float64
    zoom: Float64

    @property
    def axes(self) -> Float64:
        """Return the axes as in `View`: float64 [n, 3, 3]."""
        return np.stack([self.right, self.up, self.direction], axis=1)


def camera_poses(path: CameraPath, frames: Sequence[int]) -> CameraPoses:
    """Return the poses at some frames, from 0 on; frame `path.frames` is frame 0 of a path that loops."""
    at = np.asarray(frames, np.float64)
    if isinstance(path, KeyframePath):
        azimuth, elevation, zoom = _interpolate_keyframes(path, at)
    else:
        if isinstance(path, TurntablePath):
            azimuth = path.start + 360.0 * at / path.frames
        else:
            azimuth = path.start + 0.5 * path.swing * np.sin(2.0 * math.pi * at / path.frames)
        elevation, zoom = np.full_like(at, path.elevation), np.ones_like(at)
    (sin_a, cos_a), (sin_e, cos_e) = _sine_and_cosine(azimuth), _sine_and_cosine(elevation)
    rotation_t = _rotation_from_z_to(path.axis).T
    return CameraPoses(
        direction=np.column_stack([cos_e * sin_a, -cos_e * cos_a, sin_e]) @ rotation_t,
        right=np.column_stack([cos_a, sin_a, np.zeros_like(cos_a)]) @ rotation_t,
        up=np.column_stack([-sin_e * sin_a, sin_e * cos_a, cos_e]) @ rotation_t,
        zoom=zoom,
    )


def _sine_and_cosine(degrees: Float64) -> tuple[Float64, Float64]:
    """Return sines and cosines of angles [n], exactly 0 and 1 at right angles.

    Rays along an axis are then parallel to the faces along it. Remainders are exact: after many turns a direction is
    the same.
    """
    right_angles = np.rint(degrees / 90.0)
    rest = np.radians(np.fmod(degrees, 360.0) - 90.0 * np.fmod(right_angles, 4.0))
    sine, cosine, quarter = np.sin(rest), np.cos(rest), np.mod(right_angles, 4.0)
    return (
        np.choose(quarter.astype(np.int64), [sine, cosine, -sine, -cosine]),
        np.choose(quarter.astype(np.int64), [cosine, -sine, -cosine, sine]),
    )


def iter_camera_poses(path: CameraPath) -> Iterator[CameraPoses]:
    """Yield the poses of all frames, in chunks of bounded size that overlap by one frame."""
    for first in range(0, max(path.frames - 1, 1), _FRAMES_PER_CHUNK):
        yield camera_poses(path, range(first, min(first + _FRAMES_PER_CHUNK + 1, path.frames)))


def make_view(camera: CameraSpec, frame: int, target: Vector, distance: float, size: tuple[int, int]) -> View:
    """Return the View of a frame: the eye at `target + distance * direction`, all in world units.

    scale_px is (height / 2) / tan(field of view / 2) in perspective; orthographic, 2 distance tan(field of view / 2)
    world units fill the height. Zoom multiplies scale_px: it magnifies and does not move the eye.
    Raises InputError when the distance is not positive.
    """
    if not (distance > 0.0 and math.isfinite(distance)):
        raise InputError(
            "the eye is not at a finite distance from the target",
            where="camera.distance",
            got=f"{distance:g}",
            expected="a length greater than 0",
        )
    poses = camera_poses(camera.path, [frame])
    axes, centre = poses.axes[0], np.array(target, np.float64)
    axes.flags.writeable = centre.flags.writeable = False
    scale_px = focal_length_px(camera, size) * float(poses.zoom[0])
    if camera.projection == "orthographic":
        scale_px /= distance
    return View(axes, centre, distance, camera.projection, scale_px, size, camera.near)


def focal_length_px(camera: CameraSpec, size: tuple[int, int]) -> float:
    """Return (height / 2) / tan(field of view / 2): the pixels of a length of 1 at a depth of 1, without zoom."""
    return size[1] / 2 / math.tan(math.radians(camera.field_of_view) / 2)


def _rotation_from_z_to(axis: Vector) -> Float64:
    """Return the smallest rotation of +z onto the axis, of any length: float64 [3, 3]."""
    length = math.hypot(*axis)
    x, y, z = (component / length for component in axis)
    aside = x * x + y * y
    if aside < 1e-300:  # the axis is z to all digits, and 2 / aside may be infinite
        return np.diag([1.0, 1.0, 1.0]) if z > 0.0 else np.diag([1.0, -1.0, -1.0])
    factor = 1.0 / (1.0 + z) if z > 0.0 else (1.0 - z) / aside  # 1 / (1 + z), without cancellation near -z
    return np.array(
        [
            [1.0 - x * x * factor, -x * y * factor, x],
            [-x * y * factor, 1.0 - y * y * factor, y],
            [-x, -y, z],
        ]
    )


def _interpolate_keyframes(path: KeyframePath, at: Float64) -> tuple[Float64, Float64, Float64]:
    """Return azimuth and elevation in degrees, and zoom, at frames [n] of a path with keys: float64 [n] each."""
    frames = np.array([key.frame for key in path.keys], np.float64)
    rows = np.array([(key.azimuth, key.elevation, math.log(key.zoom)) for key in path.keys])
    if len(rows) == 1:
        azimuth, elevation = np.broadcast_to(rows[:, :2], (len(at), 2)).T
        return azimuth, elevation, np.full_like(at, path.keys[0].zoom)
    if path.loop:
        frames, rows = _close_loop(path, frames, rows)
        at = np.where(at < frames[0], at + path.frames, at)
    at = np.clip(at, frames[0], frames[-1])
    azimuth, elevation, log_zoom = (
        _interpolate(frames, column, at, smooth=path.easing == "smooth", loop=path.loop) for column in rows.T
    )
    return azimuth, elevation, np.exp(log_zoom)


def _close_loop(path: KeyframePath, frames: Float64, rows: Float64) -> tuple[Float64, Float64]:
    """Repeat the first key one loop later, with whole turns added that make the way there the shortest."""
    first, last, previous = rows[0], rows[-1], rows[-2]
    way = (first[0] - last[0]) % 360.0
    if way > 180.0 or (way == 180.0 and last[0] < previous[0]):  # a half turn continues in the direction of the path
        way -= 360.0
    return np.append(frames, frames[0] + path.frames), np.vstack([rows, [last[0] + way, *first[1:]]])


def _interpolate(frames: Float64, values: Float64, at: Float64, *, smooth: bool, loop: bool) -> Float64:
    """Evaluate the curve through (frames, values) at frames [n] from the first to the last."""
    segment = np.searchsorted(frames[1:], at)
    widths, rises = np.diff(frames), np.diff(values)
    start, length, rise = values[segment], widths[segment], rises[segment]
    x = (at - frames[segment]) / length
    if not smooth:
        return start + rise * x
    slopes = rises / widths
    velocities = np.zeros_like(values)
    velocities[1:-1] = _velocity(slopes[:-1], slopes[1:], widths[:-1], widths[1:])
    if loop:
        velocities[[0, -1]] = _velocity(slopes[-1:], slopes[:1], widths[-1:], widths[:1])
    # Cubic Hermite form, relative to the start, so that a constant stays exactly constant.
    hermite = x * x * (3.0 - 2.0 * x) * rise
    tangents = (1.0 - x) ** 2 * velocities[segment] - x * (1.0 - x) * velocities[segment + 1]
    return np.asarray(start + hermite + x * length * tangents)


def _velocity(before: Float64, after: Float64, width_before: Float64, width_after: Float64) -> Float64:
    """Return the derivative of Fritsch and Butland at a key: a harmonic mean, 0 where the direction turns."""
    weight_before, weight_after = width_before + 2.0 * width_after, 2.0 * width_before + width_after
    product = before * after
    # A quotient of products, without the reciprocal of a slope that is almost 0.
    total = weight_before * after + weight_after * before
    mean = np.divide((weight_before + weight_after) * product, total, out=np.zeros_like(product), where=product > 0.0)
    return np.asarray(mean)
