"""From an address to a connection with a Dask cluster, or to a cluster of processes on this machine."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import signal
import warnings
from collections.abc import Iterator
from multiprocessing import resource_tracker
from typing import TYPE_CHECKING, Any

from hsplat_cli.executors.options import ADDRESSES, LOCAL, require_address
from hsplat_cli.terminal import deferrable_interrupts
from renderer.cores import num_cores
from renderer.errors import InputError, RenderError

if TYPE_CHECKING:
    from distributed import Client

# Of the scheduler, to answer at all.
_CONNECT_TIMEOUT_S = 6.0
# For clients and processes, to end in peace.
_CLOSE_TIMEOUT_S = 2.0


@contextlib.contextmanager
def connect(address: str, num_workers: int | None = None) -> Iterator[Client]:
    """A connection with the scheduler at an address, or with one of this process's own at `local`.

    num_workers: processes at `local`, one for each core where it is not given; they end with the block, and with this
    process, however it ends. Raises InputError where the address is none or nobody answers, within some ten seconds.
    """
    require_address(address)
    with contextlib.ExitStack() as stack:
        stack.enter_context(_silenced_logs())
        if address == LOCAL:
            client = _client(stack.enter_context(_local_cluster(num_workers or num_cores())))
        else:
            _require_scheduler(address)
            client = _client(address)
        try:
            yield client
        finally:
            client.close(timeout=_CLOSE_TIMEOUT_S)


def _client(target: Any) -> Client:
    from distributed import Client

    return Client(target, timeout=_CONNECT_TIMEOUT_S, set_as_default=False, name="hsplat")


def _require_scheduler(address: str) -> None:
    """Raise InputError unless a scheduler answers: for a server that says nothing a Client would wait without end."""
    nobody, other = "nobody answers at this address", "what answers at this address is no Dask scheduler"
    hint = "`dask scheduler` starts one, and says its address"
    try:
        kind = asyncio.run(asyncio.wait_for(_kind_of_server(address), _CONNECT_TIMEOUT_S))
    except Exception as error:  # Dask may take the words of another kind of server for anything
        what = nobody if isinstance(error, (OSError, asyncio.TimeoutError)) else other
        raise InputError(what, where=f"--scheduler {address}", expected=ADDRESSES, hint=hint) from error
    if kind != "Scheduler":
        raise InputError(other, where=f"--scheduler {address}", got=f"a {kind}", expected=ADDRESSES, hint=hint)


async def _kind_of_server(address: str) -> str:
    """`Scheduler`, `Worker` or `Nanny`."""
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
    """Processes of one thread each."""
    from distributed import LocalCluster

    with contextlib.ExitStack() as stack:
        with deferrable_interrupts() as defer_interrupts, _sigint_blocked_in_children():
            defer_interrupts()  # a cluster that is half there cannot be ended
            try:
                cluster = LocalCluster(
                    n_workers=num_workers,
                    threads_per_worker=1,
                    processes=True,
                    memory_limit=0,  # none: nothing is to be written to disk, and no process to be ended for its size
                    dashboard_address="127.0.0.1:0",  # not the port that everybody takes
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
    """Ctrl-C reaches all processes of a terminal; those of threads that begin in this block do not notice.

    They would end, and be replaced, while this process ends them.
    """
    resource_tracker.ensure_running()  # or it would unblock the signal when it is started
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _silenced_logs() -> Iterator[None]:
    """No log lines of Dask's and of what it stands on: what matters to a user is an error or a note of ours."""
    before = logging.root.manager.disable
    logging.disable(logging.CRITICAL)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        # What has ended may complain until Python does.
        for name in list(logging.root.manager.loggerDict):
            if name.partition(".")[0] in _NOISY_LOGGERS:
                logging.getLogger(name).disabled = True
        logging.disable(before)


_NOISY_LOGGERS = ("asyncio", "distributed", "tornado")
