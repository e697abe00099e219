"""Connects to a Dask cluster at an address, or starts one of processes on this machine."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import signal
import warnings
from collections.abc import Iterator
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Any

from hsplat_cli.executors.options import ADDRESSES, LOCAL
from hsplat_cli.terminal import deferrable_interrupts
from renderer.cores import num_cores
from renderer.errors import InputError, RenderError

if TYPE_CHECKING:
    from distributed import Client

# Time for the scheduler to answer.
_CONNECT_TIMEOUT_S = 6.0
# Time for clients and processes to end by themselves.
_CLOSE_TIMEOUT_S = 2.0


@contextlib.contextmanager
def connect(address: str, num_workers: int | None = None) -> Iterator[Client]:
    """Connect to the scheduler at an address, or to one that this process starts at `local`.

    num_workers: processes at `local`, one for each core by default; they end with the block, and with this process,
    however it ends. Raises InputError where no scheduler answers within some ten seconds.
    """
    from distributed import Client

    # What matters to users of the logs of Dask, and of what it uses, is reported as an error or a note. Nothing else in
    # the program logs, and ended clients log until Python ends.
    logging.disable(logging.CRITICAL)
    with contextlib.ExitStack() as stack:
        stack.enter_context(warnings.catch_warnings())
        warnings.simplefilter("ignore")
        if address == LOCAL:
            scheduler = stack.enter_context(_local_cluster(num_workers or num_cores()))
        else:
            _require_scheduler(address)
            scheduler = address
        client = Client(scheduler, timeout=_CONNECT_TIMEOUT_S, set_as_default=False, name="hsplat")
        try:
            yield client
        finally:
            client.close(timeout=_CLOSE_TIMEOUT_S)


def _require_scheduler(address: str) -> None:
    """Raise InputError unless a scheduler answers: a Client would wait without end for a server that is silent."""
    nobody, other = "nobody answers at this address", "the server at this address is not a Dask scheduler"
    hint = "`dask scheduler` starts one, and says its address"
    try:
        kind = asyncio.run(asyncio.wait_for(_kind_of_server(address), _CONNECT_TIMEOUT_S))
    except Exception as error:  # Dask fails in many ways on the answer of another kind of server
        what = nobody if isinstance(error, (OSError, asyncio.TimeoutError)) else other
        raise InputError(what, where=f"--scheduler {address}", expected=ADDRESSES, hint=hint) from error
    if kind != "Scheduler":
        raise InputError(other, where=f"--scheduler {address}", got=f"a {kind}", expected=ADDRESSES, hint=hint)


async def _kind_of_server(address: str) -> str:
    """Return `Scheduler`, `Worker` or `Nanny`."""
    from distributed import Security
    from distributed.comm import connect
    from distributed.core import send_recv

    comm = await connect(address, timeout=_CONNECT_TIMEOUT_S, **Security().get_connection_args("client"))
    try:
        return str((await send_recv(comm, op="identity"))["type"])
    finally:
        comm.abort()


@contextlib.contextmanager
def _local_cluster(num_workers: int) -> Iterator[Any]:
    """Start processes of one thread each."""
    from distributed import LocalCluster

    with contextlib.ExitStack() as stack:
        with deferrable_interrupts() as defer_interrupts, _sigint_blocked_in_children():
            defer_interrupts()  # a cluster that is half started cannot be ended
            try:
                cluster = LocalCluster(
                    n_workers=num_workers,
                    threads_per_worker=1,
                    processes=True,
                    memory_limit=0,  # no limit: no spilling to disk, no process ended for its size
                    dashboard_address="127.0.0.1:0",  # not the default port, which may be in use
                    silence_logs=logging.CRITICAL,
                )
            except (OSError, RuntimeError) as error:
                what, where = "no cluster can be started here", "--scheduler local"
                raise RenderError(what, where=where, got=str(error)) from error
            stack.callback(_close, cluster)
        yield cluster


def _close(cluster: Any) -> None:
    with contextlib.suppress(TimeoutError):  # its processes end with this one
        cluster.close(timeout=_CLOSE_TIMEOUT_S)


@contextlib.contextmanager
def _sigint_blocked_in_children() -> Iterator[None]:
    """Block SIGINT in processes that start in this block.

    Ctrl-C reaches all processes of a terminal: they would end, and be replaced, while this process ends them.
    """
    resource_tracker.ensure_running()  # it would unblock the signal if it started later
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
