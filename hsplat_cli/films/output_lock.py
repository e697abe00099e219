"""The place of an output: only one job at a time writes it, and what is not finished is in a folder beside it."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path

from renderer.film import frame_path, is_numbered, locked, require_writable, unfinished_folder
from renderer.scene import OutputSpec


@contextlib.contextmanager
def taken(output: OutputSpec, frames: Sequence[int], sidecar: Path) -> Iterator[Path]:
    """The folder of what is not finished, which is gone after the block unless something is in it.

    Raises OutputLockedError where another job writes the same; InputError and RenderError where the output cannot be
    written.
    """
    folder = unfinished_folder(output)
    places = frames if is_numbered(output) else [0]
    with locked(folder, places, output.file):
        for file in (frame_path(output.file, frames[0]), sidecar):
            require_writable(file, folder)
        yield folder
