"""Declares and checks the options on drawing frames, `--scheduler` and `--memory`."""

from __future__ import annotations

import re
from dataclasses import dataclass

import click

from hsplat_cli.terminal import packed_options, parse_bytes
from renderer.errors import InputError, require_package
from renderer.scene import FilmScene, TimeBudget, format_value

ADDRESSES = "the address of a Dask scheduler such as tcp://node7:8786"
_ADDRESS = re.compile(r"(?:(?:tcp|tls)://)?(?:\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+):([0-9]{1,5})")


@dataclass(frozen=True)
class ExecutorSpec:
    """Describes the executor that draws.

    scheduler: the address of a Dask scheduler; None for this process. memory: bytes for the bricks of all processes of
    a machine; None for half of its free memory.
    """

    scheduler: str | None = None
    memory: int | None = None


memory_option = click.option(
    "--memory",
    metavar="SIZE",
    callback=lambda _context, _option, text: None if text is None else parse_bytes(text, where="--memory"),
    help="Use at most this much of a machine's memory for bricks, such as 2GB; half of the free memory by default.",
)
# Declares `--scheduler` and `--memory`, and hands them to the command as an ExecutorSpec, its parameter `executor`.
executor_options = packed_options(
    "executor",
    ExecutorSpec,
    click.option(
        "--scheduler", metavar="ADDRESS", help="Draw on the Dask cluster of this scheduler, tcp://node7:8786."
    ),
    memory_option,
)


def require_scheduler(address: str | None) -> None:
    """Raise InputError for a wrong address of a Dask scheduler, or where Dask is not installed. None is right."""
    if address is None:
        return
    found = _ADDRESS.fullmatch(address)
    if not (found and 0 < int(found[1]) < 2**16):
        raise InputError("not an address", where="--scheduler", got=format_value(address), expected=ADDRESSES)
    require_package("distributed", extra="cluster")


def require_untimed(address: str | None, scene: FilmScene, *, progressive: bool) -> None:
    """Raise InputError where a cluster would draw frames whose time is limited: one process must draw them."""
    if address is None or not (progressive or isinstance(scene.error.goal, TimeBudget)):
        return
    frames = "frames of --progressive" if progressive else "frames on a budget of time, error.seconds,"
    raise InputError(f"{frames} are timed and drawn one after the other, by one process", where="--scheduler")
