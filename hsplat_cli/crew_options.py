"""The options that say who draws."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import click

from renderer.errors import InputError
from renderer.scene import Scene, TimeBudget

_Command = TypeVar("_Command", bound=Callable[..., Any])

# The scheduler of processes on this machine.
LOCAL = "local"


@dataclass(frozen=True)
class CrewSpec:
    """workers: processes that draw; None for as many as is fastest. scheduler: address of a cluster's, or `local`."""

    workers: int | None = None
    scheduler: str | None = None


def crew_options(command: _Command) -> _Command:
    """A decorator for --workers and --scheduler."""
    command = click.option(
        "--scheduler", metavar="ADDRESS", help="Draw on the Dask cluster of this scheduler, tcp://node7:8786, or local."
    )(command)
    return click.option(
        "--workers",
        type=click.IntRange(min=1),
        metavar="N",
        help="Draw with N processes; as many as is fastest by default.",
    )(command)


def require_crew(spec: CrewSpec) -> None:
    """Raise InputError for an address that is none, and for options that do not go together."""
    if spec.scheduler is not None:
        # Imported here: Dask's surroundings take longer to load than --help may take to answer.
        from hsplat_cli.cluster.connection import require_address  # noqa: PLC0415

        require_address(spec.scheduler)
        if spec.workers is not None and spec.scheduler != LOCAL:
            raise InputError("the workers are those of the scheduler", where="--workers")


def require_crew_for(spec: CrewSpec, scene: Scene, *, progressive: bool = False) -> None:
    """Raise InputError where a scene cannot be drawn by these."""
    is_timed = progressive or isinstance(scene.error.goal, TimeBudget)
    if spec.scheduler is not None and is_timed:
        raise InputError("a budget of time is for one machine, and no scheduler's", where="--scheduler")
    if spec.workers is not None and spec.workers > 1 and is_timed:
        raise InputError("a budget of time is for one process, which is timed", where="--workers")
