"""What the frames of a film depend on: whether those that are there already are the ones that would be drawn."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hsplat_cli.input_file import MAX_SIDECAR_BYTES
from hsplat_cli.job import Job
from hsplat_cli.versions import package_versions, sources_digest
from renderer.kept_frames import digest, is_file, is_record
from renderer.output_files import frame_path, has_frame_files, sidecar_path
from renderer.scene import OutputSpec, Scene
from renderer.scene_schema import scene_to_dict
from renderer.schema import join, show
from renderer.volume import Volume

# How the frames become a film; not what is in them.
_OF_THE_FILM = ("file", "frames_per_second", "quality")
_MOST_DIFFERENCES = 3


def cause_of_frames(job: Job, volume: Volume, made_by: str) -> dict[str, Any]:
    """Plain data that is equal where the frames are: scene, voxels, program, driver. made_by: as GL names itself."""
    scene = scene_to_dict(job.scene)
    output = {key: value for key, value in scene["output"].items() if key not in _OF_THE_FILM}
    del scene["volume"]
    return {
        "scene": scene | {"output": output},
        "volume": {"fingerprint": volume.fingerprint},
        "versions": package_versions(),
        "sources": sources_digest(),
        "gl": made_by,
    }


def differences(before: Any, now: Any) -> str:
    """`scene.error.tolerance was 0.2`: the first few keys in which two causes differ."""
    found = list(_differences(before, now, ""))
    more = f" and {len(found) - _MOST_DIFFERENCES} more" if len(found) > _MOST_DIFFERENCES else ""
    return "; ".join(found[:_MOST_DIFFERENCES]) + more


def _differences(before: Any, now: Any, path: str) -> Iterator[str]:
    if isinstance(before, dict) and isinstance(now, dict):
        for key in [*now, *(key for key in before if key not in now)]:
            yield from _differences(before.get(key), now.get(key), join(path, key))
    elif before != now:
        yield f"{path} was {show(before)}"


@dataclass(frozen=True)
class Marks:
    """Of causes: of that of the frames, and of that of the whole film; what a sidecar holds of them."""

    frames: str
    film: str

    @classmethod
    def of(cls, cause: Mapping[str, Any], output: OutputSpec, frames: Sequence[int]) -> Marks:
        """film: also of its numbers of frames and of how they are encoded."""
        coding = [output.frames_per_second, output.quality, [*frames]]
        return cls(_mark(cause), _mark([cause, coding]))


def _mark(data: Any) -> str:
    return digest(json.dumps(data, sort_keys=True).encode())


@dataclass(frozen=True)
class Made:
    """What a sidecar, which anybody may have written, tells of its film.

    cause: of the frames, as `cause_of_frames` made it then.
    is_whole: all its frames are told of, and they are what was asked for.
    file_digest: of a film that is one file.
    records: of the frames.
    """

    marks: Marks
    cause: Any
    is_whole: bool
    file_digest: str | None
    records: Sequence[Mapping[str, Any]]

    def is_up_to_date(self, marks: Marks, output: OutputSpec, frames: Sequence[int]) -> bool:
        """Whether the film of these causes is there, whole, as it was made."""
        if self.marks != marks or not self.is_whole or [record["frame"] for record in self.records] != [*frames]:
            return False
        if not has_frame_files(output):
            return is_file(output.file, self.file_digest)
        return all(is_file(frame_path(output.file, record["frame"]), record["digest"]) for record in self.records)


def made_before(scene: Scene, frames: Sequence[int]) -> Made | None:
    """What is told by the sidecar of the output of these frames, if there is one that tells enough."""
    data = _read(sidecar_path(scene, frames))
    try:
        cause, schedule, records = data["cause"], data["schedule"], data["frames"]
        whole = [record for record in records if is_record(record)]
        is_whole = schedule["met"] is True and len(whole) == len(records)
        return Made(Marks(cause["frames"], cause["film"]), cause.get("of"), is_whole, data.get("digest"), whole)
    except (KeyError, TypeError):
        return None


def _read(path: Path) -> Any:
    try:
        if path.stat().st_size > MAX_SIDECAR_BYTES:
            return None
        return json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return None
