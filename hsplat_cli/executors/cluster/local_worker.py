"""Runs a worker process of the cluster on this machine.

`python -m hsplat_cli.executors.cluster.local_worker FD` reads its settings from a file that it inherits, says on
standard output when it is connected, and works until its parent ends it.
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
from dataclasses import asdict, dataclass
from typing import Any

import dask.config
import distributed
from distributed import Security

from hsplat_cli.executors.cluster.silence import silent_libraries

# What a worker writes once it is connected.
READY = b"\n"


class WithoutHTTP:
    """A server of Dask without the port for pages and metrics, which every user of the machine could read."""

    def start_http_server(self, *_: object, **__: object) -> None:
        """Do nothing. Called by Dask."""


# Dask reads the configuration of its servers by the names of their classes.
class Worker(WithoutHTTP, distributed.Worker):  # type: ignore[misc]  # mypy does not read distributed
    """A worker with one port."""


@dataclass(frozen=True)
class WorkerSettings:
    """A worker's settings. listen: the options of its port; certificate and key: PEM; folder: of its files."""

    scheduler: str
    listen: dict[str, Any]
    certificate: str
    key: str
    num_threads: int
    folder: str

    def to_json(self) -> bytes:
        """Return them as text for a file."""
        return json.dumps(asdict(self)).encode()


def _main() -> None:
    """Run a worker. Argument: the file descriptor of its settings."""
    with open(int(sys.argv[1]), "rb") as file:
        settings = WorkerSettings(**json.load(file))
    with silent_libraries(), dask.config.set({"temporary-directory": settings.folder}):
        asyncio.run(_work(settings))


async def _work(settings: WorkerSettings) -> None:
    """Connect to the scheduler, and do what it says until it closes this worker."""
    security = Security(
        tls_ca_file=settings.certificate,
        tls_worker_cert=settings.certificate,
        tls_worker_key=settings.key,
        require_encryption=True,
    )
    # Without a limit of memory nothing is spilled to disk, and no process is ended for its size.
    options = {"nthreads": settings.num_threads, "memory_limit": 0, "security": security}
    async with Worker(settings.scheduler, **settings.listen, **options) as worker:
        os.write(sys.stdout.fileno(), READY)
        await worker.finished()


if __name__ == "__main__":
    _main()
