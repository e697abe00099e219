"""Camera paths: which way the camera looks at each frame, and the View that this makes.

About the default axis +z, azimuth a and elevation e put the eye at `target + distance * direction` with

    direction = (cos e sin a, -cos e cos a, sin e)
    right     = (cos a, sin a, 0)
    up        = (-sin e sin a, sin e cos a, cos e)

which is a right-handed frame at every elevation, the poles included. About another axis all three are turned by the
smallest rotation that takes +z to that axis; about -z by half a turn about x.

Between keyframes azimuth, elevation and the logarithm of the zoom are interpolated, each for itself. The eye so stays
on its sphere, the picture never rolls against the axis, keys of one elevation make a turntable, and azimuths 0 and 360
a full turn. Great circles would keep only the first of these: between two keys of one elevation they rise above it.
`smooth` easing is the monotone piecewise cubic of F. N. Fritsch and J. Butland, "A method for constructing local
monotone piecewise cubic interpolants", SIAM J. Sci. Stat. Comput. 5 (1984): continuous velocity, and no value beyond
its two keys. A path that does not loop starts and ends at rest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from renderer.camera import Float64, View
from renderer.errors import InputError
from renderer.scene import CameraSpec, KeyframePath, RockerPath, TurntablePath, Vector

CameraPath = TurntablePath | RockerPath | KeyframePath


@dataclass(frozen=True)
class Pose:
    """Where the camera is, up to distance: an orthonormal right-handed frame (right, up, direction) in the world.

    direction, right, up: float64 [3]; `direction` points from the target to the eye. zoom: magnification, > 0.
    """

    direction: Float64
    right: Float64
    up: Float64
    zoom: float


def camera_pose(path: CameraPath, frame: int) -> Pose:
    """The pose at a frame, 0 <= frame < path.frames; frame `path.frames` would be frame 0 of a path that loops."""
    if isinstance(path, TurntablePath):
        azimuth, elevation, zoom = path.start + 360.0 * frame / path.frames, path.elevation, 1.0
    elif isinstance(path, RockerPath):
        swing = 0.5 * path.swing * math.sin(2.0 * math.pi * frame / path.frames)
        azimuth, elevation, zoom = path.start + swing, path.elevation, 1.0
    else:
        azimuth, elevation, zoom = _between_keys(path, frame)
    a, e = math.radians(azimuth), math.radians(elevation)
    turn = _rotation_from_z_to(path.axis)
    return Pose(
        direction=turn @ np.array([math.cos(e) * math.sin(a), -math.cos(e) * math.cos(a), math.sin(e)]),
        right=turn @ np.array([math.cos(a), math.sin(a), 0.0]),
        up=turn @ np.array([-math.sin(e) * math.sin(a), math.sin(e) * math.cos(a), math.cos(e)]),
        zoom=zoom,
    )


def make_view(camera: CameraSpec, frame: int, target: Vector, distance: float, size: tuple[int, int]) -> View:
    """The View of a frame: the eye at `target + distance * direction`, all in world units.

    scale_px is (height / 2) / tan(field of view / 2) in perspective; orthographic, 2 distance tan(field of view / 2)
    world units fill the height. Zoom multiplies scale_px, so it magnifies and does not move the eye.
    Raises InputError when the distance is not positive.
    """
    if not (distance > 0.0 and math.isfinite(distance)):
        raise InputError(
            "the eye is not at a finite distance from the target",
            where="camera.distance",
            got=f"{distance:g}",
            expected="a length greater than 0",
        )
    pose = camera_pose(camera.path, frame)
    view_from_world = np.eye(4)
    view_from_world[:3, :3] = pose.right, pose.up, pose.direction
    view_from_world[:3, 3] = -view_from_world[:3, :3] @ (np.asarray(target, np.float64) + distance * pose.direction)
    view_from_world.flags.writeable = False
    scale_px = size[1] / 2 / math.tan(math.radians(camera.field_of_view) / 2) * pose.zoom
    if camera.projection == "orthographic":
        scale_px /= distance
    return View(view_from_world, camera.projection, scale_px, size, camera.near)


def _rotation_from_z_to(axis: Vector) -> Float64:
    """float64 [3, 3]: the smallest rotation of +z onto the axis, which need not have length 1."""
    length = math.hypot(*axis)
    x, y, z = (component / length for component in axis)
    aside = x * x + y * y
    if aside < 1e-300:  # the axis is z to all digits, and 2 / aside might not be finite
        return np.diag([1.0, 1.0, 1.0]) if z > 0.0 else np.diag([1.0, -1.0, -1.0])
    share = 1.0 / (1.0 + z) if z > 0.0 else (1.0 - z) / aside  # 1 / (1 + z), without cancellation near -z
    return np.array(
        [
            [1.0 - x * x * share, -x * y * share, x],
            [-x * y * share, 1.0 - y * y * share, y],
            [-x, -y, z],
        ]
    )


def _between_keys(path: KeyframePath, frame: int) -> tuple[float, float, float]:
    """Azimuth and elevation in degrees, and zoom, between the keys of a path."""
    frames = [float(key.frame) for key in path.keys]
    rows = [(key.azimuth, key.elevation, math.log(key.zoom)) for key in path.keys]
    if len(rows) == 1:
        return rows[0][0], rows[0][1], path.keys[0].zoom
    if path.loop:
        frames, rows = _closed(path, frames, rows)
    at = frame + path.frames if path.loop and frame < frames[0] else min(max(frame, frames[0]), frames[-1])
    azimuth, elevation, log_zoom = (
        _interpolated(frames, column, at, smooth=path.easing == "smooth", loop=path.loop)
        for column in zip(*rows, strict=True)
    )
    return azimuth, elevation, math.exp(log_zoom)


def _closed(
    path: KeyframePath, frames: list[float], rows: list[tuple[float, float, float]]
) -> tuple[list[float], list[tuple[float, float, float]]]:
    """Keys with the first one repeated one loop later, at whole turns that make the way there the shortest."""
    first, last, previous = rows[0], rows[-1], rows[-2]
    way = (first[0] - last[0]) % 360.0  # [0, 360), onward
    if way > 180.0 or (way == 180.0 and last[0] < previous[0]):  # a half turn goes on the way the path was going
        way -= 360.0
    return [*frames, frames[0] + path.frames], [*rows, (last[0] + way, first[1], first[2])]


def _interpolated(frames: Sequence[float], values: Sequence[float], at: float, *, smooth: bool, loop: bool) -> float:
    """The curve through (frames, values) at a frame between the first and the last."""
    segment = next(i for i in range(len(frames) - 1) if at <= frames[i + 1])
    length = frames[segment + 1] - frames[segment]
    start, end = values[segment], values[segment + 1]
    x = (at - frames[segment]) / length
    if not smooth:
        return start + (end - start) * x
    widths = [b - a for a, b in pairwise(frames)]
    slopes = [(b - a) / width for (a, b), width in zip(pairwise(values), widths, strict=True)]
    velocities = [_velocity(slopes[i - 1], slopes[i], widths[i - 1], widths[i]) for i in range(1, len(slopes))]
    ends = _velocity(slopes[-1], slopes[0], widths[-1], widths[0]) if loop else 0.0
    velocities = [ends, *velocities, ends]
    # Cubic Hermite form, written around the start so that a constant stays exactly constant.
    hermite = x * x * (3.0 - 2.0 * x) * (end - start)
    tangents = (1.0 - x) ** 2 * velocities[segment] - x * (1.0 - x) * velocities[segment + 1]
    return start + hermite + x * length * tangents


def _velocity(before: float, after: float, width_before: float, width_after: float) -> float:
    """Fritsch and Butland's derivative at a key between two segments: a harmonic mean, 0 where the direction turns."""
    if before * after <= 0.0:
        return 0.0
    weight_before, weight_after = width_before + 2.0 * width_after, 2.0 * width_before + width_after
    return (weight_before + weight_after) / (weight_before / before + weight_after / after)
