"""Declares the options that say what draws, `--workers`, `--scheduler` and `--memory`, and checks them."""

from __future__ import annotations

import re
from dataclasses import dataclass

import click

from hsplat_cli.terminal import option_group, parse_bytes
from renderer.errors import InputError, require_package
from renderer.scene import Scene, TimeBudget, format_value
from renderer.system import MemoryShare, num_cores

# The scheduler of processes on this machine.
LOCAL = "local"

ADDRESSES = "the address of a Dask scheduler such as tcp://node7:8786, or local for processes on this machine"
_ADDRESS = re.compile(r"(?:(?:tcp|tls)://)?(?:\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+):([0-9]{1,5})")


@dataclass(frozen=True)
class ExecutorSpec:
    """A choice of processes that draw.

    workers: their number on this machine, where it was given. scheduler: address of a cluster's, or `local`, if given.
    memory: bytes for the bricks of all processes of a machine, if given.
    """

    workers: int | None = None
    scheduler: str | None = None
    memory: int | None = None

    @property
    def address(self) -> str | None:
        """Return the address of a scheduler that is already there; None where this machine draws."""
        return None if self.scheduler == LOCAL else self.scheduler

    @property
    def num_local_processes(self) -> int:
        """Return the number of processes of this machine that draw; one is this process."""
        return self.workers or (num_cores() if self.scheduler == LOCAL else 1)

    @property
    def share(self) -> MemoryShare:
        """Return the memory of this process, which draws alone, or trial frames beside others."""
        num = self.num_local_processes
        return MemoryShare(self.memory, num + 1 if num > 1 else 1)


workers_option = click.option(
    "--workers",
    type=click.IntRange(min=1),
    metavar="N",
    help="Draw with N processes, by Dask; one process with all threads by default.",
)
memory_option = click.option(
    "--memory",
    metavar="SIZE",
    callback=lambda _context, _option, text: None if text is None else parse_bytes(text, where="--memory"),
    help="Let what is drawn take 2GB of a machine's memory; half of what is free by default.",
)
executor_options = option_group(
    workers_option,
    click.option(
        "--scheduler",
        metavar="ADDRESS",
        help="Draw on the Dask cluster of this scheduler, tcp://node7:8786; local for a process on each core.",
    ),
    memory_option,
)


def require_executor(spec: ExecutorSpec) -> None:
    """Raise InputError for a wrong address, options that exclude each other, or where Dask is not installed."""
    if spec.address is not None:
        found = _ADDRESS.fullmatch(spec.address)
        if not (found and 0 < int(found[1]) < 2**16):
            raise InputError("not an address", where="--scheduler", got=format_value(spec.address), expected=ADDRESSES)
        require_package("distributed", extra="cluster")
        if spec.workers is not None:
            raise InputError("the workers are those of the scheduler", where="--workers")
    elif spec.num_local_processes > 1:
        for package in ("distributed", "cryptography"):
            require_package(package, extra="cluster")


def require_executor_for(spec: ExecutorSpec, scene: Scene, *, progressive: bool = False) -> None:
    """Raise InputError where a scene cannot be drawn like this: timed frames need one process."""
    if not (progressive or isinstance(scene.error.goal, TimeBudget)):
        return
    what = "frames of --progressive" if progressive else "frames on a budget of time, error.seconds,"
    where = "--scheduler" if spec.scheduler is not None else "--workers"
    if spec.scheduler is not None or (spec.workers or 1) > 1:
        raise InputError(f"{what} are timed and drawn one after the other, by one process", where=where)
