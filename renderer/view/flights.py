"""Evaluate flights: paths on which the eye passes through keys along a smooth curve.

Between keys eye, target, roll and the logarithm of the zoom follow one centripetal Catmull-Rom curve: its velocity is
continuous, and it has no loops between keys (C. Yuksel, S. Schaefer and J. Keyser, "Parameterization and applications
of Catmull-Rom curves", Computer-Aided Design 43, 2011). The eye's speed is constant along it, or between keys with
frames; where the eye stays, that of the target is.
"""

from __future__ import annotations

import numpy as np

from renderer.scene import FlightPath, Motion
from renderer.volume import Float64

# Chords along each part of a curve, from which its length is taken: that of an arc of 90 degrees to 1e-6.
_NUM_CHORDS = 512
# A place of the camera, float64 [8]: its eye, its target, its roll in degrees, and the logarithm of its zoom.
EYE, TARGET, ROLL, LOG_ZOOM = slice(0, 3), slice(3, 6), 6, 7


def fly(path: FlightPath, start: Float64 | None, frames: Float64) -> Float64:
    """Return the places at frames [n] of a flight: float64 [n, 8]. start: where the camera was before, if anywhere."""
    places = [np.array([*key.position, *key.target, key.roll, 0.0]) for key in path.keys]
    at_frames = [key.frame for key in path.keys]
    if start is not None and at_frames[0] != 0:  # a flight whose first key is at frame 0 begins there
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
    """Return how far the eye has come at places on a curve, or between keys where it stays, the target: float64 [n]."""
    moves = np.diff(_on_curve(curve, at), axis=0).reshape(len(curve) - 1, _NUM_CHORDS, -1)
    eye, target = (np.linalg.norm(moves[..., part], axis=2) for part in (EYE, TARGET))
    return np.append(0.0, np.cumsum(np.where(eye.any(axis=1, keepdims=True), eye, target)))


def _on_curve(curve: Float64, at: Float64) -> Float64:
    """Return places on a Catmull-Rom curve through keys [k, 8], of which each is at its number: float64 [n, 8]."""
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
