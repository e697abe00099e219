"""What the frames of a film depend on: whether those that are there already are the ones that would be drawn."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from hsplat_cli.scenes import Job, is_shallow
from hsplat_cli.terminal import first_few
from renderer.film import (
    Record,
    data_digest,
    file_digest,
    file_matches_digest,
    frame_matches_digest,
    frame_path,
    has_frame_files,
    is_frame_record,
    translate_os_errors,
)
from renderer.scene import (
    MAX_SIDECAR_BYTES,
    OutputSpec,
    format_value,
    join_keys,
    scene_to_dict,
    schedule_to_dict,
    with_draw_order,
)
from renderer.versions import package_versions, sources_digest

# How the frames become a film; not what is in them.
_ENCODING_KEYS = ("file", "frames_per_second", "quality")
_MOST_DIFFERENCES = 3


@dataclass(frozen=True)
class JobFingerprint:
    """What a film depends on; a sidecar holds it as `cause`.

    frames: a mark of what its frames depend on, which is equal where they are.
    film: a mark also of their numbers and of how they are encoded.
    of: what its frames depend on, as plain data just as JSON has it; in a sidecar whatever is there.
    """

    frames: str
    film: str
    of: Any

    @classmethod
    def make(cls, of: Any, output: OutputSpec, frames: Sequence[int]) -> JobFingerprint:
        """frames: the numbers of them."""
        mark = data_digest(of)
        return cls(mark, data_digest([mark, output.frames_per_second, output.quality, [*frames]]), of)

    @property
    def is_intact(self) -> bool:
        """Whether `of` is what it was when the mark was made."""
        return self.frames == data_digest(self.of)


def job_fingerprint(job: Job, fingerprint: str, made_by: str) -> JobFingerprint:
    """That of a job's film: scene, voxels, program, driver.

    Of tolerances that were found it has what they were found for, which a film that is made again takes over.
    fingerprint: of the volume. made_by: as GL names itself.
    """
    scene = scene_to_dict(with_draw_order(job.scene))
    rest = {key: value for key, value in scene["error"].items() if key not in schedule_to_dict(job.scene.error)}
    output = {key: value for key, value in scene["output"].items() if key not in _ENCODING_KEYS}
    del scene["volume"]
    of = {
        "scene": scene | {"output": output, "error": {**job.requested_error, **rest}},
        "volume": {"fingerprint": fingerprint},
        "versions": package_versions(),
        "sources": sources_digest(),
        "gl": made_by,
    }
    return JobFingerprint.make(json.loads(json.dumps(of)), job.scene.output, job.frames)


def differences(before: Any, now: Any) -> str:
    """`scene.error.tolerance was 0.2`: the first few keys in which two causes differ."""
    return first_few(list(_differences(before, now, "")), _MOST_DIFFERENCES, "; ")


def reason(before: Any, now: Any) -> str:
    """`differences`, or what else is to be said of a cause that has another mark; before: whatever was read."""
    if not isinstance(before, Mapping) or not before:
        return "its scene is not on record"
    return differences(before, now) or "the record of its scene was changed"


def _differences(before: Any, now: Any, path: str) -> Iterator[str]:
    if isinstance(before, dict) and isinstance(now, dict):
        for key in [*now, *(key for key in before if key not in now)]:
            yield from _differences(before.get(key), now.get(key), join_keys(path, key))
    elif before != now:
        yield f"{path} was {format_value(before)}"


# In sidecars


@dataclass(frozen=True)
class Made:
    """What a sidecar, which anybody may have written, tells of its film.

    is_whole: all its frames are told of, and they are what was asked for.
    file_digest: of a film that is one file.
    records: of the frames.
    output: the scene's, as plain data.
    """

    cause: JobFingerprint
    is_whole: bool
    file_digest: str | None
    records: Sequence[Record]
    output: Mapping[str, Any]

    def has_same_frames(self, cause: JobFingerprint) -> bool:
        """Whether its frames are as they would be drawn for this cause."""
        return self.cause.frames == cause.frames

    def is_up_to_date(self, cause: JobFingerprint, output: OutputSpec, frames: Sequence[int]) -> bool:
        """Whether the film of this cause is there, whole, as it was made."""
        if self.cause.film != cause.film or not self.is_whole or [each["frame"] for each in self.records] != [*frames]:
            return False
        if not has_frame_files(output):
            return file_matches_digest(output.file, self.file_digest)
        files = ((frame_path(output.file, each["frame"]), each["digest"]) for each in self.records)
        return all(frame_matches_digest(path, mark, output) for path, mark in files)

    def why_rerender(self, cause: JobFingerprint, output: OutputSpec, frames: Sequence[int]) -> str | None:
        """Why a film that is not up to date is drawn anew, as the end of a sentence about it; None where there is none,
        or where its frames, which are files, are kept or are gone one by one."""
        told = None
        if not self.has_same_frames(cause):
            told = reason(self.cause.of, cause.of)
        elif has_frame_files(output):
            return None
        elif self.cause.film != cause.film or [each["frame"] for each in self.records] != [*frames]:
            now = {"frames_per_second": output.frames_per_second, "quality": output.quality}
            before = {key: self.output.get(key) for key in now}
            told = differences({"output": before}, {"output": now}) or "it has other frames"
        if not has_frame_files(output) and not output.file.exists():
            return told and f"is not there, and its sidecar is that of another film: {told}"
        if told is not None:
            return f"is drawn anew, for what is there is another film: {told}"
        if not self.is_whole:
            return "is drawn anew, for what is there is not all that was asked for"
        return "is drawn anew, for what is there is not the file that its sidecar tells of"


def read_recorded_film(sidecar: Path, output: OutputSpec) -> Made | None:
    """What is told by the sidecar of an output, if there is one that tells enough."""
    data = _read(sidecar)
    try:
        cause, schedule, records = recorded_fingerprint(data), data["schedule"], data["frames"]
        # The pictures of a film that is one file are there no more.
        whole = [record for record in records if is_frame_record(record, has_digest=has_frame_files(output))]
        is_whole = schedule["met"] is True and len(whole) == len(records)
        scene = data.get("scene")
        told = scene.get("output") if isinstance(scene, dict) else None
        return (
            None
            if cause is None
            else Made(cause, is_whole, data.get("digest"), whole, told if isinstance(told, dict) else {})
        )
    except (KeyError, TypeError):
        return None


def recorded_fingerprint(data: Any) -> JobFingerprint | None:
    """That in the content of a sidecar, if there is one."""
    try:
        told = data["cause"]
        of = told.get("of")
        return JobFingerprint(told["frames"], told["film"], of if is_shallow(of) else None)
    except (AttributeError, KeyError, TypeError):
        return None


def fingerprint_record(cause: JobFingerprint, output: OutputSpec) -> dict[str, Any]:
    """For the sidecar of an output that is there: by what the next job sees whether it has nothing to do."""
    if has_frame_files(output):
        return {"cause": asdict(cause)}
    with translate_os_errors(output.file):
        return {"cause": asdict(cause), "digest": file_digest(output.file)}


def with_digests(frames: Sequence[Record], output: OutputSpec) -> list[Record]:
    """The records of frames that are there with the digests of their files, where they have files of their own."""
    if not has_frame_files(output):
        return [*frames]
    found: list[Record] = []
    for frame in frames:
        path = frame_path(output.file, frame["frame"])
        with translate_os_errors(path):
            found.append(frame if "digest" in frame else {**frame, "digest": file_digest(path)})
    return found


def _read(path: Path) -> Any:
    try:
        if path.stat().st_size > MAX_SIDECAR_BYTES:
            return None
        return json.loads(path.read_bytes())
    except (OSError, ValueError, RecursionError):
        return None
