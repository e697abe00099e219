"""Describe a film and its frames as plain data, for the sidecar."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from renderer.film import Record
from renderer.frame.frame import Frame
from renderer.frame.stage import Stage, finest_level_at
from renderer.scene import scene_to_dict, with_tolerances
from renderer.system import package_versions

_MIN_VISIBLE_OPACITY = 0.5 / 255  # less opacity than this changes no pixel of 8 bits


def frame_record(frame: Frame) -> dict[str, Any]:
    """Return a frame's number, tolerance, cells and seconds, as `renderer.film.is_frame_record` expects them."""
    record: dict[str, Any] = {
        "frame": frame.number,
        "tolerance": frame.tolerance,
        "cells": frame.num_cells,
        "splats": frame.num_splats,
        "seconds": frame.seconds,
    }
    predicted = {} if frame.predicted_seconds is None else {"predicted_seconds": frame.predicted_seconds}
    blank = {"blank": True} if np.max(frame.radiance[..., 3], initial=0.0) < _MIN_VISIBLE_OPACITY else {}
    return record | predicted | blank


def film_record(stage: Stage, frames: Sequence[Record], made_by: str) -> dict[str, Any]:
    """Return the first part of a sidecar: a scene that draws the same frames, with all defaults, its volume and camera.

    frames: their records. made_by: device and driver, as GL names them.
    """
    scene, volume, pyramid = stage.scene, stage.volume, stage.pyramid
    finest_level = min(finest_level_at(stage, frame["tolerance"]) for frame in frames)
    if scene.error.goal is not None:
        scene = with_tolerances(scene, {frame["frame"]: frame["tolerance"] for frame in frames})
    return {
        "scene": scene_to_dict(scene),
        "volume": {
            "name": volume.name,
            "fingerprint": volume.fingerprint,
            "dtype": str(volume.values.dtype),
            "shape": list(volume.shape_xyz),
            "world_from_index": volume.world_from_index,
        },
        "camera": {"target": stage.target, "distance": stage.distance},
        "pyramid": {"levels": pyramid.num_levels, "bytes": pyramid.num_bytes, "finest_level_drawn": finest_level},
        "gl": made_by,
        "versions": package_versions(),
    }


def visibility_notes(frames: Sequence[Record]) -> list[str]:
    """Return notes for the user if nothing is visible on some or all pictures."""
    if all(frame["cells"] == 0 for frame in frames):
        return [
            "nothing is visible: the transfer function hides every voxel; `hsplat info` shows which values there are"
        ]
    empty = [frame for frame in frames if frame["splats"] == 0 or frame.get("blank")]
    if not empty:
        return []
    among = f" on {len(empty)} of {len(frames)} frames, the first of them frame {empty[0]['frame']}" * (len(frames) > 1)
    why = ": the volume is out of the picture, nearer than `camera.near`, too small or too transparent"
    return [f"nothing is in view{among}{why if any(frame['splats'] for frame in empty) else ''}"]
