"""Starts a Dask cluster of processes on this machine, which other users of the machine cannot use.

A scheduler and its workers run any function that they are sent. Dask's TCP ports take messages from every user of the
machine. Here they speak TLS with a certificate that is made for this cluster, which only its processes have, and refuse
all others. The workers' folder, where Python looks for modules first, belongs to this user; Dask's default,
/tmp/dask-scratch-space, can be made by any user.

The scheduler runs in this process. Workers are children like all others (`renderer.system.child_processes`). Dask's own
way to start them shares semaphores with them, which stay in /dev/shm where all processes are killed.
"""

from __future__ import annotations

import contextlib
import logging
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from queue import SimpleQueue

import dask.config
import distributed
from distributed import Security, SpecCluster

from hsplat_cli.executors.cluster.local_worker import READY, WithoutHTTP, WorkerSettings
from renderer.errors import RenderError
from renderer.system import ChildProcesses, deferrable_interrupts, describe_exit, num_cores, open_anonymous_file

# Time for Dask's threads to end by themselves: Dask waits again at the end of the program.
_CLOSE_TIMEOUT_S = 10.0
_LISTEN = {"host": "127.0.0.1", "protocol": "tls://"}
_WORKER_MODULE = "hsplat_cli.executors.cluster.local_worker"


class Scheduler(WithoutHTTP, distributed.Scheduler):  # type: ignore[misc]  # mypy does not read distributed
    """A scheduler with one port."""


@contextlib.contextmanager
def local_cluster(num_workers: int) -> Iterator[SpecCluster]:
    """Start processes, which share the cores; they end with the block, and with this process, however it ends.

    Raises RenderError where they cannot be started.
    """
    with contextlib.ExitStack() as stack:
        folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="hsplat-", ignore_cleanup_errors=True))
        security = Security.temporary()
        num_threads = max(1, num_cores() // num_workers)
        try:
            cluster = stack.enter_context(_scheduler(security, folder))
            certificate, key = security.tls_ca_file, security.tls_client_key
            settings = WorkerSettings(cluster.scheduler_address, _LISTEN, certificate, key, num_threads, folder)
            stack.enter_context(_WorkerProcesses(settings)).start(num_workers)
        except (OSError, RuntimeError) as error:
            what, where = "no processes can be started", f"--workers {num_workers}"
            raise RenderError(what, where=where, got=str(error)) from error
        yield cluster


class _WorkerProcesses(contextlib.AbstractContextManager["_WorkerProcesses"]):
    """An owner of worker processes. One that ends once it was connected is replaced; all end with the block."""

    def __init__(self, settings: WorkerSettings) -> None:
        self._settings = settings.to_json()
        self._children = ChildProcesses()
        self._threads: list[threading.Thread] = []
        self._starts: SimpleQueue[str] = SimpleQueue()
        self._lock, self._is_closed = threading.Lock(), False

    def start(self, num: int) -> None:
        """Start processes, and wait until all are connected. Raises OSError where one cannot be started."""
        self._threads = [threading.Thread(target=self._keep_one_running, daemon=True) for _ in range(num)]
        for thread in self._threads:
            thread.start()
        for _ in self._threads:
            if failure := self._starts.get():
                raise OSError(failure)

    def __exit__(self, *_: object) -> None:
        """End all processes, and wait for their ends."""
        with self._lock, self._children:
            self._is_closed = True
        for thread in self._threads:
            thread.join()

    def _keep_one_running(self) -> None:
        """Start a process, and another one whenever it ends; report each start, and end with one that fails."""
        while (process := self._start_one()) is not None:
            with process:  # until its end
                assert process.stdout is not None
                is_connected = process.stdout.read(len(READY)) == READY
                if is_connected:
                    self._starts.put("")
            if not is_connected:
                self._starts.put(describe_exit(process.returncode))
                return

    def _start_one(self) -> subprocess.Popen[bytes] | None:
        """Start a process; return None after the end of the block, and where it cannot be started."""
        with self._lock, open_anonymous_file() as settings:
            if self._is_closed:
                return None
            settings.write(self._settings)
            settings.seek(0)
            descriptor = settings.fileno()
            try:
                return self._children.start(
                    _WORKER_MODULE, [str(descriptor)], pass_fds=[descriptor], stdout=subprocess.PIPE
                )
            except OSError as error:
                self._starts.put(str(error))
                return None


@contextlib.contextmanager
def _scheduler(security: Security, folder: str) -> Iterator[SpecCluster]:
    """Start a scheduler in this process, without workers. folder: for its files."""
    options = {**_LISTEN, "port": 0, "dashboard": False, "security": security}
    with deferrable_interrupts() as defer_interrupts:
        defer_interrupts()  # what is half started cannot be ended
        with dask.config.set({"temporary-directory": folder}), _same_sys_path():
            cluster = SpecCluster(
                scheduler={"cls": Scheduler, "options": options},
                worker={},
                security=security,
                silence_logs=logging.CRITICAL,
            )
    try:
        yield cluster
    finally:
        with contextlib.suppress(TimeoutError):
            cluster.close(timeout=_CLOSE_TIMEOUT_S)


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
