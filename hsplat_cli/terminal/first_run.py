"""The first run on a machine compiles, which takes some seconds: said, so that nobody waits in the dark."""

from __future__ import annotations

import click


def report_first_run(*, quiet: bool) -> None:
    """Say on the standard error stream that kernels are going to be compiled, if they are."""
    from renderer.jit import has_cached_kernels

    if not (quiet or has_cached_kernels()):
        click.echo("compiling for this machine: the first run takes some seconds longer", err=True)
