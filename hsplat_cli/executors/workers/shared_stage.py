"""Shares a stage between processes, in memory without a name, which is freed with the last of them."""

from __future__ import annotations

import mmap
import os
import tempfile

from hsplat_cli.scenes import guard_mapping
from renderer.errors import RenderError
from renderer.frame import Stage, deserialize_stage, serialize_stage

# The most that some systems write at once.
_MAX_WRITE_BYTES = 1 << 30


class SharedStage:
    """A stage that other processes map by an inherited file descriptor; to be closed.

    stage: the stage, with arrays in the shared memory. Callers that use it, and drop the original, have the volume in
    memory once. Voxels that are mapped from a file stay there.
    """

    def __init__(self, stage: Stage) -> None:
        self.descriptor = _anonymous_file()
        try:
            _write(self.descriptor, stage)
            self.stage = map_stage(self.descriptor)
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Close the descriptor; mapped stages stay."""
        os.close(self.descriptor)


def map_stage(descriptor: int) -> Stage:
    """Map the stage of a descriptor of shared memory, without reading it; the descriptor can then be closed.

    Nobody writes to its arrays, so pages stay shared.
    """
    return deserialize_stage(memoryview(mmap.mmap(descriptor, 0, access=mmap.ACCESS_COPY)), guard_mapping)


def _anonymous_file() -> int:
    """Open a file without a name, in memory where the system can, else on disk."""
    try:
        if hasattr(os, "memfd_create"):
            return os.memfd_create("hsplat-stage", os.MFD_CLOEXEC)
        with tempfile.TemporaryFile(prefix="hsplat-") as file:
            return os.dup(file.fileno())
    except OSError as error:
        raise _out_of_memory_error(error) from error


def _write(descriptor: int, stage: Stage) -> None:
    """Write a stage. Mapped memory that has no room would be a signal that kills; here it is an error."""
    try:
        for piece in serialize_stage(stage, without_files=False):
            rest = piece
            while rest:
                rest = rest[os.write(descriptor, rest[:_MAX_WRITE_BYTES]) :]
    except OSError as error:
        raise _out_of_memory_error(error) from error


def _out_of_memory_error(error: OSError) -> RenderError:
    return RenderError(
        "the volume cannot be shared with the processes that draw",
        got=error.strerror or str(error),
        hint="--workers 1 needs less memory",
    )
