"""Lock an output: only one job at a time writes it, and what is not finished is in a folder beside it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path

from renderer.film.atomic import require_writable
from renderer.film.lock import lock_slots
from renderer.film.names import frame_path, is_numbered, unfinished_folder
from renderer.scene import OutputSpec


@contextlib.contextmanager
def locked_output(output: OutputSpec, frames: Sequence[int], sidecar: Path) -> Iterator[Path]:
    """Lock the output, and give the folder of what is not finished. After the block the folder is gone if it is empty.

    Raises OutputLockedError if another job is writing the same output; InputError and RenderError where the output
    cannot be written.
    """
    folder = unfinished_folder(output)
    places = frames if is_numbered(output) else [0]
    with lock_slots(folder, places, output.file):
        for file in (frame_path(output.file, frames[0]), sidecar):
            require_writable(file, folder)
        yield folder
