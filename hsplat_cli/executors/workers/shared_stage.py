"""A stage in memory that several processes map: it has no name, and is gone when the last of them is."""

from __future__ import annotations

import mmap
import os
import tempfile

from hsplat_cli.scenes import guard_mapping
from renderer.errors import RenderError
from renderer.frame import Stage, deserialize_stage, serialize_stage

# What some systems write at most at once.
_MAX_WRITE_BYTES = 1 << 30


class SharedStage:
    """A stage that other processes can have by a file descriptor that they inherit; to be closed.

    stage: the stage, with arrays in the shared memory. Whoever goes on with this one and lets go of the one that it was
    made from has the volume in memory once. One whose voxels are mapped from a file leaves them there.
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
        """Let go of the descriptor; stages that were mapped stay."""
        os.close(self.descriptor)


def map_stage(descriptor: int) -> Stage:
    """The stage that a descriptor of shared memory leads to, without reading it; the descriptor can then be closed.

    Whether its arrays can be written to is as it was. Nobody writes, so that pages stay shared: it would be seen by the
    writer alone.
    """
    return deserialize_stage(memoryview(mmap.mmap(descriptor, 0, access=mmap.ACCESS_COPY)), guard_mapping)


def _anonymous_file() -> int:
    """In memory where the system can, otherwise on disk, under no name."""
    try:
        if hasattr(os, "memfd_create"):
            return os.memfd_create("hsplat-stage", os.MFD_CLOEXEC)
        with tempfile.TemporaryFile(prefix="hsplat-") as file:
            return os.dup(file.fileno())
    except OSError as error:
        raise _out_of_memory_error(error) from error


def _write(descriptor: int, stage: Stage) -> None:
    """Written and not mapped and then filled: where there is no room that is an error, and not a signal that kills."""
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
