"""Starts a Dask cluster of processes on this machine, which other users of the machine cannot use.

A scheduler, a worker and its nanny run any function that they are sent. Dask's TCP ports take messages from every user
of the machine. Here they speak TLS with a certificate that is made for this cluster, which only its processes have,
and refuse all others. The workers' folder, where Python looks for modules first, belongs to this user; Dask's default,
/tmp/dask-scratch-space, can be made by any user.
"""

from __future__ import annotations

import contextlib
import logging
import signal
import sys
import tempfile
from collections.abc import Iterator
from multiprocessing import resource_tracker
from typing import Any

import dask.config
import distributed
from distributed import Nanny, Security, SpecCluster

from renderer.errors import RenderError
from renderer.system import deferrable_interrupts, num_cores

# Time for processes to end by themselves, on a busy machine too: Dask waits again at the end of the program.
_CLOSE_TIMEOUT_S = 10.0


# Dask reads the configuration of its servers by the names of their classes.
class _WithoutHTTP:
    """Opens no port for pages and metrics, which every user of the machine could read."""

    def start_http_server(self, *_: object, **__: object) -> None:
        """Do nothing. Called by Dask."""


class Scheduler(_WithoutHTTP, distributed.Scheduler):  # type: ignore[misc]  # mypy does not read distributed
    """A scheduler with one port."""


class Worker(_WithoutHTTP, distributed.Worker):  # type: ignore[misc]
    """A worker with one port."""


@contextlib.contextmanager
def local_cluster(num_workers: int) -> Iterator[SpecCluster]:
    """Start processes, which share the cores; they end with the block, and with this process, however it ends."""
    with contextlib.ExitStack() as stack:
        with deferrable_interrupts() as defer_interrupts, _signals_blocked_in_children():
            defer_interrupts()  # a cluster that is half started cannot be ended
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="hsplat-", ignore_cleanup_errors=True))
            try:
                with dask.config.set({"temporary-directory": folder}), _same_sys_path():
                    cluster = _start(num_workers)
            except (OSError, RuntimeError) as error:
                what, where = "no processes can be started", f"--workers {num_workers}"
                raise RenderError(what, where=where, got=str(error)) from error
            stack.callback(_close, cluster)
        yield cluster


def _start(num_workers: int) -> SpecCluster:
    security = Security.temporary()
    listen = {"host": "127.0.0.1", "protocol": "tls://", "security": security}
    # Without a limit of memory nothing is spilled to disk, and no process is ended for its size.
    limits = {"nthreads": max(1, num_cores() // num_workers), "memory_limit": 0}
    quiet = {"silence_logs": logging.CRITICAL}
    worker = {"cls": Nanny, "options": {**listen, **limits, **quiet, "worker_class": Worker}}
    return SpecCluster(
        scheduler={"cls": Scheduler, "options": {**listen, "port": 0, "dashboard": False}},
        workers=dict.fromkeys(range(num_workers), worker),
        worker=worker,
        security=security,
        **quiet,
    )


@contextlib.contextmanager
def _same_sys_path() -> Iterator[None]:
    """Remove the folders in which Dask has Python look for modules first.

    They are removed before this process ends, and another user could then make one of the same name.
    """
    before = list(sys.path)
    try:
        yield
    finally:
        sys.path[:] = before


def _close(cluster: Any) -> None:
    with contextlib.suppress(TimeoutError):  # its processes end with this one
        cluster.close(timeout=_CLOSE_TIMEOUT_S)


@contextlib.contextmanager
def _signals_blocked_in_children() -> Iterator[None]:
    """Block SIGINT and SIGHUP in processes that start in this block.

    They reach all processes of a terminal, which would end, and be replaced, while this process ends them.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGHUP})
    try:
        resource_tracker.ensure_running()  # which ignores SIGINT itself, and unblocks it here
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
