"""Run `hsplat cite FILM`: print for a paper how a film was made, from its sidecar alone."""

from __future__ import annotations

from pathlib import Path

import click

from hsplat_cli.commands.shared_options import FILE, quiet_option
from hsplat_cli.scenes import read_film_record
from hsplat_cli.terminal import Reporter
from renderer.system import join_lines


@click.command()
@click.argument("film", type=FILE)
@quiet_option(help="Print no notes.")
def cite(film: Path, reporter: Reporter) -> None:
    """Print how a film was made, for a paper, and BibTeX.

    FILM is a film, the template of its numbered frames such as frames/{frame:04}.png, or the JSON file beside them.
    Only the JSON file is read. A paragraph on methods describes the volume, the drawing, and how exact the film is.
    """
    # Imported here to keep --help fast.
    from renderer.record import bibtex, methods_text

    path, record = read_film_record(film)
    reporter.result(join_lines([methods_text(record, path), "", *bibtex(record).splitlines()]))
    if record.accuracy is None:
        how = f"`hsplat verify {film}` measures it, and so does render unless error.probes is 0"
        reporter.status(f"note: the sidecar does not say how exact the file is: {how}")
