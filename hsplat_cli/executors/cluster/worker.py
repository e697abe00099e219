"""Runs on the workers of a cluster: a worker gets the serialised stage once, and draws frame after frame.

A worker needs no file of the client. The client and the scheduler import this module, too, because they name its
functions.
"""

from __future__ import annotations

import os
import weakref
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from renderer.accuracy import open_prober
from renderer.draw import Rasterizer, open_rasterizer
from renderer.errors import ContextLostError
from renderer.frame import ScheduleController, deserialize_stage
from renderer.job import draw_frames
from renderer.record import FrameRecord
from renderer.system import MemoryShare, package_versions, sources_digest


class DrawnPictures(NamedTuple):
    """Holds the result of drawing a frame on a worker.

    contents: the content of the file of each picture, by the index of its kind. record: the frame's record for the
    sidecar. versions: the versions of packages and the name of the device that drew the frame, by name.
    """

    contents: dict[int, bytes]
    record: FrameRecord
    versions: dict[str, str]


class SerializedStage:
    """Holds the bytes of a stage, as `serialize_stage` returns them; on a worker also the stage's rasterizer.

    Dask keeps a SerializedStage in each worker's memory for as long as the client needs it, even if the client is
    killed. Copies for other workers have only the bytes. One thread draws, because OpenGL's contexts belong to threads.

    content: uint8 [num_bytes].
    """

    def __init__(self, content: npt.NDArray[np.uint8]) -> None:
        self._content = content
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="hsplat")  # starts at the first task
        self._rasterizers: list[Rasterizer] = []  # at most one
        # The finalizer is not called when Python ends, because threads have ended by then.
        weakref.finalize(self, _close, self._thread, self._rasterizers).atexit = False

    def __reduce__(self) -> tuple[type[SerializedStage], tuple[npt.NDArray[np.uint8]]]:
        return SerializedStage, (self._content,)

    def __sizeof__(self) -> int:
        return self._content.nbytes

    def draw(self, number: int, num_threads: int, memory: MemoryShare) -> DrawnPictures:
        """Draw a frame, after the frames that other threads have requested.

        num_threads: number of threads that draw, unless the environment variable LP_NUM_THREADS is set. memory: this
        process's share of the machine's memory for bricks.
        """
        return self._thread.submit(self._draw, number, num_threads, memory).result()

    def _draw(self, number: int, num_threads: int, memory: MemoryShare) -> DrawnPictures:
        if not self._rasterizers:
            os.environ.setdefault("LP_NUM_THREADS", str(num_threads))
            content = self._content if self._content.flags.writeable else self._content.copy()
            self._stage = deserialize_stage(content.data)
            self._controller, self._prober = ScheduleController(self._stage), open_prober(self._stage, num_threads)
            self._rasterizers.append(open_rasterizer(self._stage.scene, memory))
            self._versions = package_versions() | {"device": self._rasterizers[0].device}
        try:
            (drawn,) = draw_frames(
                self._stage, [number], self._rasterizers[0], self._controller, self._prober, is_overlapped=False
            )
        except ContextLostError:
            self._rasterizers.pop().release()
            raise
        pictures = {kind: picture.content for kind, picture in drawn.pictures.items()}
        return DrawnPictures(pictures, drawn.record, self._versions)


def _close(thread: ThreadPoolExecutor, rasterizers: list[Rasterizer]) -> None:
    """Release the OpenGL context and end the thread, without waiting for it."""
    for rasterizer in rasterizers:
        thread.submit(rasterizer.release)
    thread.shutdown(wait=False)


def describe_worker() -> dict[str, str]:
    """Return the versions of packages in this process, by name, and as `sources` the digest of the drawing code.

    The digest is needed because checkouts with different sources may have the same version.
    """
    return package_versions() | {"sources": sources_digest()}


def draw_on_worker(stage_data: SerializedStage, number: int, memory: MemoryShare) -> DrawnPictures:
    """Draw a frame in this worker.

    memory: this process's share of the machine's memory for bricks; only the share at the first frame has an effect.
    """
    from distributed import get_worker

    return stage_data.draw(number, get_worker().state.nthreads, memory)
