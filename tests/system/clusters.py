"""Starts Dask clusters for tests: a scheduler in this process, and workers in others."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager

from distributed import LocalCluster, Security

from renderer.system import num_cores


@contextmanager
def running_cluster(
    num_workers: int, *, security: Security | None = None, variables: dict[str, str] | None = None
) -> Iterator[LocalCluster]:
    """Start a cluster whose workers share the cores, and are replaced when they die.

    variables: of the workers' environment.
    """
    with LocalCluster(
        n_workers=num_workers,
        threads_per_worker=max(1, num_cores() // max(1, num_workers)),
        memory_limit=0,
        dashboard_address=":0",
        security=security,
        silence_logs=logging.CRITICAL,
        env=variables,
    ) as cluster:
        yield cluster
