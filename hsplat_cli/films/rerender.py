"""A film that is made again from its sidecar: what differs from when it was made before."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hsplat_cli.scenes import Job, Original
from renderer.scene import format_value, schedule_to_dict
from renderer.versions import package_versions, sources_digest

_LONGEST_NAME = 200


def rerender_notes(job: Job, made_by: str) -> list[str]:
    """That the film did not meet what was asked for, if so, and that other versions, sources or OpenGL make it now."""
    return (
        [] if job.original is None else [*_missed_goal_notes(job, job.original), *_version_notes(job.original, made_by)]
    )


def _missed_goal_notes(job: Job, original: Original) -> list[str]:
    if original.other_schedule_keys.get("met") is not False:  # older sidecars do not say
        return []
    asked = ", ".join(f"{name} {format_value(value)}" for name, value in _recorded_request(job, original).items())
    return [f"the film that is made again did not meet what was asked for: {asked}"]


def _recorded_request(job: Job, original: Original) -> Mapping[str, Any]:
    """What the film that is made again was asked for, as far as that is told."""
    return job.requested_error if original.requested_error is None else schedule_to_dict(original.requested_error)


def _version_notes(original: Original, made_by: str) -> list[str]:
    before, now = original.tool_versions, package_versions() | {"GL": made_by, "sources": sources_digest()}
    changed = [
        f"{name} {printable_name(now[name])}, which was {printable_name(before[name])}"
        for name in now
        if name in before and before[name] != now[name]
    ]
    if not changed:
        return []
    return [f"the bytes may differ from those of the film before, made with other versions: {'; '.join(changed)}"]


def printable_name(value: object) -> str:
    """What a file says that anybody may have written, for the terminal."""
    is_plain = isinstance(value, str) and value.isprintable() and len(value) <= _LONGEST_NAME
    return str(value) if is_plain else format_value(value)


def inherited_schedule(job: Job, *, is_unfinished: bool) -> dict[str, Any]:
    """What the record of the schedule has from that of the film before.

    Whether that met what was asked for, and why, holds for this one only where the same is asked for.
    """
    if job.original is None:
        return {}
    is_same = not is_unfinished and job.requested_error == _recorded_request(job, job.original)
    told = job.original.other_schedule_keys if is_same else {}
    return {**told, "made_from": job.original.path.name}
