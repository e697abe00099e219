"""Evaluate flights: paths on which the eye passes through keys along a smooth curve.

Eye, target, roll and the logarithm of the zoom follow one centripetal Catmull-Rom curve, which has a continuous
velocity and no loops between keys (C. Yuksel, S. Schaefer and J. Keyser, "Parameterization and applications of
Catmull-Rom curves", Computer-Aided Design 43, 2011). The eye's speed is constant over the whole curve, or between keys
that have frames. Between keys at which the eye stays, the target's speed is constant.
"""

from __future__ import annotations

import numpy as np

from renderer.scene import FlightPath, Motion
from renderer.volume import Float64

# The number of chords by which the length of a curve between two keys is measured. For an arc of 90 degrees, the error
# is 1e-6.
_NUM_CHORDS = 512
# A place of the camera is an array [8] of eye, target, roll and zoom. These are the columns of the eye.
EYE = slice(0, 3)
# The columns of the target in the array [8] of a place of the camera.
TARGET = slice(3, 6)
# The column of the roll, in degrees, in the array [8] of a place of the camera.
ROLL = 6
# The column of the logarithm of the zoom in the array [8] of a place of the camera.
LOG_ZOOM = 7


def fly(path: FlightPath, start: Float64 | None, frames: Float64) -> Float64:
    """Return the places of the camera (eye, target, roll, logarithm of the zoom) on a flight, float64 [n, 8].

    start: the place at the end of the piece of the path before the flight; None without such a piece. frames: the
    frames, counted from the start of the flight, [n].
    """
    places = [np.array([*key.position, *key.target, key.roll, 0.0]) for key in path.keys]
    at_frames = [key.frame for key in path.keys]
    if start is not None and at_frames[0] != 0:  # a first key at frame 0 replaces `start`
        places.insert(0, start)
        at_frames.insert(0, None if at_frames[0] is None else 0)
    curve = np.array(places)
    if len(curve) == 1 or path.frames == 1:
        return np.repeat(curve[:1], len(frames), axis=0)
    at = np.linspace(0.0, len(curve) - 1, (len(curve) - 1) * _NUM_CHORDS + 1)
    way = _way(curve, at)
    keys = {frame: float(way[number * _NUM_CHORDS]) for number, frame in enumerate(at_frames) if frame is not None}
    keys = keys or {0: 0.0, path.frames - 1: float(way[-1])}
    motion = Motion(tuple(keys), tuple(keys.values()), path.easing)
    return _on_curve(curve, np.interp([motion.at(frame) for frame in frames.tolist()], way, at))


def _way(curve: Float64, at: Float64) -> Float64:
    """Return the length of a flight's curve from its start to each of some parameters, float64 [n].

    The length is measured along the eye's way, or along the target's way between keys at which the eye stays. curve:
    the places at the keys, [k, 8]. at: the parameters, [n]; key k has the parameter k.
    """
    moves = np.diff(_on_curve(curve, at), axis=0).reshape(len(curve) - 1, _NUM_CHORDS, -1)
    eye, target = (np.linalg.norm(moves[..., part], axis=2) for part in (EYE, TARGET))
    return np.append(0.0, np.cumsum(np.where(eye.any(axis=1, keepdims=True), eye, target)))


def _on_curve(curve: Float64, at: Float64) -> Float64:
    """Return places of the camera on a Catmull-Rom curve through keys, float64 [n, 8].

    curve: the places at the keys, [k, 8]. at: the parameters of the places, [n]; key k has the parameter k.
    """
    steps = np.sqrt(np.linalg.norm(np.diff(curve[:, :6], axis=0), axis=1))[:, None]
    steps[steps == 0.0] = 1.0
    slopes = np.diff(curve, axis=0) / steps
    weights = steps[1:] / (steps[1:] + steps[:-1])
    inner = weights * slopes[:-1] + (1.0 - weights) * slopes[1:]
    velocities = np.concatenate([slopes[:1], inner, slopes[-1:]])
    part = np.minimum(at.astype(np.int64), len(steps) - 1)
    x, rise = (at - part)[:, None], curve[part + 1] - curve[part]
    before, after = (steps[part] * velocities[key] for key in (part, part + 1))
    hermite = x * x * (3.0 - 2.0 * x) * rise
    return np.asarray(curve[part] + hermite + x * (1.0 - x) * ((1.0 - x) * before - x * after))
