"""Prints that the first run on a machine compiles."""

from hsplat_cli.terminal.reporter import Reporter


def report_first_run(*, quiet: bool) -> None:
    """Print a status if kernels are going to be compiled."""
    Reporter(quiet).announce_compilation()
