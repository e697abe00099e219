"""What a command is to draw: a scene, and which frames of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hsplat_cli.frame_range import parse_frames
from hsplat_cli.scene_file import load_scene
from renderer.scene import Scene
from renderer.scene_schema import schedule_to_dict


@dataclass(frozen=True)
class Job:
    """frames: their numbers, ascending.
    asked: how exact, as a section `error` says it: `{"splats": 100000}`.
    fingerprint: of the volume that it has to be, where that is known.
    """

    scene: Scene
    frames: Sequence[int]
    asked: Mapping[str, Any]
    fingerprint: str | None = None


def load_job(
    path: Path,
    *,
    overrides: Sequence[str] = (),
    frames: str | None = None,
    volume: Path | None = None,
    output: Path | None = None,
) -> Job:
    """The job that a scene file describes, with what the options of the command line change in it."""
    scene = load_scene(path, overrides=overrides, volume=volume, output=output)
    return Job(scene, parse_frames(frames, scene.camera.path.frames), schedule_to_dict(scene.error))
