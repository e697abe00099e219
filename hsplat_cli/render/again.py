"""A film that is made again from its sidecar: what differs from when it was made first."""

from __future__ import annotations

from typing import Any

from hsplat_cli.job import Job
from hsplat_cli.versions import package_versions
from renderer.schema import show


def maker_notes(job: Job, made_by: str) -> list[str]:
    """What other versions, or another OpenGL, have made the film than the one before."""
    if job.original is None:
        return []
    now = package_versions() | {"GL": made_by}
    then = job.original.made_with
    differ = [
        f"{name} {show(now[name])}, not {show(then[name])}" for name in now if then.get(name, now[name]) != now[name]
    ]
    if not differ:
        return []
    return [f"the bytes may differ from those of the film before, which other versions made: {'; '.join(differ)}"]


def recorded_schedule(job: Job) -> dict[str, Any]:
    """What the record of the schedule takes over from the film before: whether it was met, and what was measured."""
    return {} if job.original is None else {**job.original.told, "made_from": job.original.path.name}
