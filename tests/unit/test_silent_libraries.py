"""Clusters of several threads leave loggers and warnings as they were, in whichever order they end."""

from __future__ import annotations

import logging
import warnings

from hsplat_cli.executors.cluster.connection import SilentLibraries


def test_the_last_of_several_users_restores() -> None:
    silent_libraries, level, filters = SilentLibraries(), logging.root.manager.disable, list(warnings.filters)
    for _ in range(2):
        with silent_libraries:
            silent_libraries.__enter__()
        assert logging.root.manager.disable == logging.CRITICAL
        silent_libraries.__exit__()
        assert (logging.root.manager.disable, list(warnings.filters)) == (level, filters)
