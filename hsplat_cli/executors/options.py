"""The options that say who draws."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import click

from renderer.errors import InputError, require_package
from renderer.scene import Scene, TimeBudget, format_value

_Command = TypeVar("_Command", bound=Callable[..., Any])

# The scheduler of processes on this machine.
LOCAL = "local"

ADDRESSES = "the address of a Dask scheduler such as tcp://node7:8786, or local for processes on this machine"
_ADDRESS = re.compile(r"(?:(?:tcp|tls)://)?(?:\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+):([0-9]{1,5})")


def require_address(address: str) -> None:
    """Raise InputError for what cannot be the address of a scheduler, or where no Dask is installed to talk to one."""
    found = _ADDRESS.fullmatch(address)
    if address != LOCAL and not (found and 0 < int(found[1]) < 2**16):
        raise InputError("not an address", where="--scheduler", got=format_value(address), expected=ADDRESSES)
    require_package("distributed", extra="cluster")


@dataclass(frozen=True)
class ExecutorSpec:
    """workers: processes that draw; None for as many as is fastest. scheduler: address of a cluster's, or `local`."""

    workers: int | None = None
    scheduler: str | None = None


def workers_option(command: _Command) -> _Command:
    """A decorator for --workers."""
    return click.option(
        "--workers",
        type=click.IntRange(min=1),
        metavar="N",
        help="Draw with N processes; as many as is fastest by default.",
    )(command)


def executor_options(command: _Command) -> _Command:
    """A decorator for --workers and --scheduler."""
    command = click.option(
        "--scheduler", metavar="ADDRESS", help="Draw on the Dask cluster of this scheduler, tcp://node7:8786, or local."
    )(command)
    return workers_option(command)


def require_executor(spec: ExecutorSpec) -> None:
    """Raise InputError for an address that is none, and for options that do not go together."""
    if spec.scheduler is not None:
        require_address(spec.scheduler)
        if spec.workers is not None and spec.scheduler != LOCAL:
            raise InputError("the workers are those of the scheduler", where="--workers")


def require_executor_for(spec: ExecutorSpec, scene: Scene, *, progressive: bool = False) -> None:
    """Raise InputError where a scene cannot be drawn by these."""
    if not (progressive or isinstance(scene.error.goal, TimeBudget)):
        return
    what = "frames of --progressive" if progressive else "frames on a budget of time, error.seconds,"
    where = "--scheduler" if spec.scheduler is not None else "--workers"
    if spec.scheduler is not None or (spec.workers or 1) > 1:
        raise InputError(f"{what} are timed and drawn one after the other, by one process", where=where)
