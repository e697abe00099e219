"""Shares a stage between processes, in memory without a name, which is freed with the last of them."""

from __future__ import annotations

import mmap
import os

from hsplat_cli.scenes import guard_mapping
from renderer.errors import RenderError
from renderer.frame import Stage, deserialize_stage, serialize_stage
from renderer.system import open_anonymous_file


def share_stage(stage: Stage) -> int:
    """Write a stage to shared memory and return its file descriptor, which other processes can inherit and map.

    Voxels that are mapped from a file stay there. Raises RenderError where there is not enough memory.
    """
    try:
        with open_anonymous_file() as file:
            # Written, because mapped memory that has no room would be a signal that kills.
            for piece in serialize_stage(stage, without_files=False):
                file.write(piece)
            file.flush()
            return os.dup(file.fileno())
    except OSError as error:
        raise RenderError(
            "the volume cannot be shared with the processes that draw",
            got=error.strerror or str(error),
            hint="--workers 1 needs less memory",
        ) from error


def map_stage(descriptor: int) -> Stage:
    """Map the stage of a descriptor of shared memory, without reading it; the descriptor can then be closed.

    Nobody writes to its arrays, so pages stay shared.
    """
    return deserialize_stage(memoryview(mmap.mmap(descriptor, 0, access=mmap.ACCESS_COPY)), guard_mapping)
