"""The place of an output: only one job at a time writes it, and what is not finished is in a folder beside it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from hsplat_cli.job import Job
from renderer.output_files import first_files, is_numbered, sidecar_path, unfinished_folder
from renderer.output_lock import locked
from renderer.staging import require_writable


@contextlib.contextmanager
def taken(job: Job) -> Iterator[Path]:
    """The folder of what is not finished, which is gone after the block unless something is in it.

    Raises InputError where another job writes the same, and where the output cannot be written, RenderError, too.
    """
    output = job.scene.output
    folder = unfinished_folder(sidecar_path(output.file))
    places = job.frames if is_numbered(output) else [0]
    with locked(folder, places, output.file):
        for file in first_files(output, job.frames):
            require_writable(file, folder)
        yield folder
