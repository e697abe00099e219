"""Compute and compare fingerprints: digests of everything that the frames of a film depend on."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from hsplat_cli.scenes import Job, is_shallow
from hsplat_cli.terminal import first_few
from renderer.film import data_digest, file_digest, has_frame_files, translate_os_errors
from renderer.scene import OutputSpec, format_value, join_keys, scene_to_dict, schedule_to_dict, with_draw_order
from renderer.system import package_versions, sources_digest

# These keys say how frames become a film and what is told of it, not what is in them.
_ENCODING_KEYS = ("file", "frames_per_second", "quality", "record_paths")
_MAX_DIFFERENCES = 3
# More levels than a fingerprint has.
_MAX_LEVELS = 12


@dataclass(frozen=True)
class JobFingerprint:
    """Identifies what a film depends on, besides the numbers of its frames. The sidecar stores it as `cause`.

    frames: the digest of `of`.
    film: how the frames were encoded, as plain JSON data.
    of: what the frames depend on, as plain JSON data.
    """

    frames: str
    film: Any
    of: Mapping[str, Any]

    @classmethod
    def make(cls, of: Mapping[str, Any], output: OutputSpec) -> JobFingerprint:
        """Return the fingerprint of a film."""
        encoding = {"frames_per_second": output.frames_per_second, "quality": output.quality}
        return cls(data_digest(of), {"output": encoding}, of)


def job_fingerprint(job: Job, volume_fingerprint: str, driver: str) -> JobFingerprint:
    """Return the fingerprint of a job's film: scene, voxels, versions and driver.

    The schedule counts as it was requested, not as the tolerances that were found for it, so a film that is rendered
    from its sidecar has the same fingerprint.
    """
    scene = scene_to_dict(with_draw_order(job.scene))
    rest = {key: value for key, value in scene["error"].items() if key not in schedule_to_dict(job.scene.error)}
    output = {key: value for key, value in scene["output"].items() if key not in _ENCODING_KEYS}
    del scene["volume"]
    of = {
        "scene": scene | {"output": output, "error": {**job.requested_error, **rest}},
        "volume": {"fingerprint": volume_fingerprint},
        "versions": package_versions(),
        "sources": sources_digest(),
        "gl": driver,
    }
    return JobFingerprint.make(json.loads(json.dumps(of)), job.scene.output)


def recorded_fingerprint(data: Any) -> JobFingerprint | None:
    """Return the fingerprint in the content of a sidecar, or None."""
    try:
        found = JobFingerprint(**data["cause"])
    except (KeyError, TypeError):
        return None
    return found if is_shallow(data["cause"], _MAX_LEVELS) and isinstance(found.of, dict) else None


def fingerprint_record(fingerprint: JobFingerprint, output: OutputSpec) -> dict[str, Any]:
    """Return what the sidecar of an existing output stores, by which the next job sees that the film is up to date."""
    record = {"cause": asdict(fingerprint)}
    if has_frame_files(output):
        return record
    with translate_os_errors(output.file):
        return record | {"digest": file_digest(output.file)}


def describe_differences(before: Any, now: Any) -> str:
    """Return the first few keys in which two fingerprints' data differ: `scene.error.tolerance was 0.2`."""
    found = [f"{path} was {format_value(old)}" for path, old, _ in differences(before, now)]
    return first_few(found, _MAX_DIFFERENCES, "; ")


def describe_mismatch(before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Return why recorded data, which may be any, has another fingerprint than `now`."""
    if not before:
        return "its scene is not recorded"
    return describe_differences(before, now) or "the record of its scene was changed"


def differences(before: Any, now: Any, path: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yield the dotted paths of the values that differ, and both values: None where there is none."""
    if isinstance(before, list) and isinstance(now, list) and any(isinstance(item, dict) for item in now):
        before, now = dict(enumerate(before)), dict(enumerate(now))
    if isinstance(before, dict) and isinstance(now, dict):
        for key in dict.fromkeys([*now, *before]):
            yield from differences(before.get(key), now.get(key), join_keys(path, key))
    elif before != now:
        yield path, before, now
