"""Evaluate flights: paths on which the eye passes through keys along a smooth curve.

Between keys eye, target, roll and the logarithm of the zoom follow one centripetal Catmull-Rom curve: its velocity is
continuous, and it has no loops between keys (C. Yuksel, S. Schaefer and J. Keyser, "Parameterization and applications
of Catmull-Rom curves", Computer-Aided Design 43, 2011). The eye's speed is constant along it, or between keys with
frames; where the eye stays, that of the target is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from renderer.scene import FlightPath, Motion
from renderer.volume import Float64

# Chords along each part of a curve, from which its length is taken: that of an arc of 90 degrees to 1e-6.
_NUM_CHORDS = 512
_EYE, _TARGET, _ROLL, _LOG_ZOOM = slice(0, 3), slice(3, 6), 6, 7


@dataclass(frozen=True)
class FlightPlace:
    """Where a camera is: float64 [8], its eye, its target, its roll in degrees, and the logarithm of its zoom."""

    numbers: Float64

    @classmethod
    def of(cls, eye: Float64, target: Float64, roll: float = 0.0, zoom: float = 1.0) -> FlightPlace:
        """Return a place by its parts."""
        return cls(np.array([*eye, *target, roll, math.log(zoom)]))


@dataclass(frozen=True)
class FlightPoses:
    """Places of a camera at n frames: eye and target float64 [n, 3], roll in degrees and zoom float64 [n]."""

    eye: Float64
    target: Float64
    roll: Float64
    zoom: Float64


def fly(path: FlightPath, start: FlightPlace | None, frames: Sequence[float]) -> FlightPoses:
    """Return where the camera is at frames of a flight. start: where it was before, if anywhere."""
    places = [FlightPlace.of(np.array(key.position), np.array(key.target), key.roll).numbers for key in path.keys]
    at_frames = [key.frame for key in path.keys]
    if start is not None and at_frames[0] != 0:  # a flight whose first key is at frame 0 begins there
        places, at_frames = (
            [start.numbers, *places],
            [0, *at_frames] if at_frames[0] is not None else [None] * (len(places) + 1),
        )
    curve = np.array(places)
    if len(curve) == 1 or path.frames == 1:
        found = np.repeat(curve[:1], len(frames), axis=0)
    else:
        ways, lengths = _ways(curve)
        total = np.append(0.0, np.cumsum(lengths))
        keys = [each for each in at_frames if each is not None]
        motion = Motion(tuple(keys) or (0, path.frames - 1), tuple(total[[0, -1]] if not keys else total), path.easing)
        found = np.array([_point(curve, ways, total, float(motion.at(frame))) for frame in frames])
    return FlightPoses(found[:, _EYE], found[:, _TARGET], found[:, _ROLL], np.exp(found[:, _LOG_ZOOM]))


def _ways(curve: Float64) -> tuple[list[Float64], list[float]]:
    """Return how far the eye has come at even steps along each part of a curve, and the lengths of the parts."""
    ways = []
    for part in range(len(curve) - 1):
        points = _on_curve(curve, part, np.linspace(0.0, 1.0, _NUM_CHORDS + 1))
        chords = np.linalg.norm(np.diff(points[:, _EYE], axis=0), axis=1)
        if not chords.any():
            chords = np.linalg.norm(np.diff(points[:, _TARGET], axis=0), axis=1)
        ways.append(np.append(0.0, np.cumsum(chords)))
    return ways, [float(way[-1]) for way in ways]


def _point(curve: Float64, ways: Sequence[Float64], total: Float64, length: float) -> Float64:
    """Return the place on a curve at a length from its start: float64 [8]."""
    part = min(max(int(np.searchsorted(total, length, side="right")) - 1, 0), len(ways) - 1)
    way = ways[part]
    x = float(np.interp(length - total[part], way, np.linspace(0.0, 1.0, len(way)))) if way[-1] > 0.0 else 0.0
    return np.asarray(_on_curve(curve, part, np.array([x]))[0])


def _on_curve(curve: Float64, part: int, x: Float64) -> Float64:
    """Return the places at shares x [n] of one part of a Catmull-Rom curve through keys [k, 8]: float64 [n, 8]."""
    steps = np.sqrt(np.linalg.norm(np.diff(curve[:, :6], axis=0), axis=1))
    steps[steps == 0.0] = 1.0
    slopes = np.diff(curve, axis=0) / steps[:, None]
    velocities = np.concatenate([slopes[:1], slopes[1:], slopes[-1:]])
    weights = (steps[1:] / (steps[1:] + steps[:-1]))[:, None]
    velocities[1:-1] = weights * slopes[:-1] + (1.0 - weights) * slopes[1:]
    rise, (before, after) = curve[part + 1] - curve[part], steps[part] * velocities[part : part + 2]
    x = x[:, None]
    hermite = x * x * (3.0 - 2.0 * x) * rise
    return np.asarray(curve[part] + hermite + x * (1.0 - x) * ((1.0 - x) * before - x * after))
