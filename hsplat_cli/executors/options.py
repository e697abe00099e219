"""Declares the option `--scheduler`, and checks it."""

from __future__ import annotations

import re

import click

from renderer.errors import InputError, require_package
from renderer.scene import Scene, TimeBudget, format_value

ADDRESSES = "the address of a Dask scheduler such as tcp://node7:8786"
_ADDRESS = re.compile(r"(?:(?:tcp|tls)://)?(?:\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+):([0-9]{1,5})")

scheduler_option = click.option(
    "--scheduler", metavar="ADDRESS", help="Draw on the Dask cluster of this scheduler, tcp://node7:8786."
)


def require_scheduler(address: str | None) -> None:
    """Raise InputError for a wrong address, or where Dask is not installed."""
    if address is None:
        return
    found = _ADDRESS.fullmatch(address)
    if not (found and 0 < int(found[1]) < 2**16):
        raise InputError("not an address", where="--scheduler", got=format_value(address), expected=ADDRESSES)
    require_package("distributed", extra="cluster")


def require_untimed(address: str | None, scene: Scene, *, progressive: bool) -> None:
    """Raise InputError for a cluster that would draw timed frames: they need one process."""
    if address is None or not (progressive or isinstance(scene.error.goal, TimeBudget)):
        return
    what = "frames of --progressive" if progressive else "frames on a budget of time, error.seconds,"
    raise InputError(f"{what} are timed and drawn one after the other, by one process", where="--scheduler")
