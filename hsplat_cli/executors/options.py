"""Declares the options that say what draws, `--workers` and `--scheduler`, and checks them."""

from __future__ import annotations

import re
from dataclasses import dataclass

import click

from hsplat_cli.terminal import option_group
from renderer.errors import InputError, require_package
from renderer.scene import Scene, TimeBudget, format_value

# The scheduler of processes on this machine.
LOCAL = "local"

ADDRESSES = "the address of a Dask scheduler such as tcp://node7:8786, or local for processes on this machine"
_ADDRESS = re.compile(r"(?:(?:tcp|tls)://)?(?:\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+):([0-9]{1,5})")


@dataclass(frozen=True)
class ExecutorSpec:
    """The choice of processes that draw.

    workers: their number, None for the fastest. scheduler: address of a cluster's, or `local`.
    """

    workers: int | None = None
    scheduler: str | None = None


workers_option = click.option(
    "--workers",
    type=click.IntRange(min=1),
    metavar="N",
    help="Draw with N processes; as many as are fastest by default.",
)
executor_options = option_group(
    workers_option,
    click.option(
        "--scheduler", metavar="ADDRESS", help="Draw on the Dask cluster of this scheduler, tcp://node7:8786, or local."
    ),
)


def require_executor(spec: ExecutorSpec) -> None:
    """Raise InputError for a wrong address, options that exclude each other, or where Dask is not installed."""
    address = spec.scheduler
    if address is None:
        return
    found = _ADDRESS.fullmatch(address)
    if address != LOCAL and not (found and 0 < int(found[1]) < 2**16):
        raise InputError("not an address", where="--scheduler", got=format_value(address), expected=ADDRESSES)
    for package in ("distributed", *["cryptography"] * (address == LOCAL)):
        require_package(package, extra="cluster")
    if spec.workers is not None and address != LOCAL:
        raise InputError("the workers are those of the scheduler", where="--workers")


def require_executor_for(spec: ExecutorSpec, scene: Scene, *, progressive: bool = False) -> None:
    """Raise InputError where a scene cannot be drawn like this: timed frames need one process."""
    if not (progressive or isinstance(scene.error.goal, TimeBudget)):
        return
    what = "frames of --progressive" if progressive else "frames on a budget of time, error.seconds,"
    where = "--scheduler" if spec.scheduler is not None else "--workers"
    if spec.scheduler is not None or (spec.workers or 1) > 1:
        raise InputError(f"{what} are timed and drawn one after the other, by one process", where=where)
