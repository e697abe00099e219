"""Runs on the workers of a cluster: a worker gets the serialised stage once, and draws frame after frame.

Needs no file of the client. The client and the scheduler import this module, too: they pass its functions on by name.
"""

from __future__ import annotations

import functools
import os
import threading
import weakref
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import numpy.typing as npt

from hsplat_cli.executors.frame_result import FrameResult, draw_locally
from renderer.draw import open_rasterizer
from renderer.errors import ContextLostError
from renderer.frame import ScheduleController, deserialize_stage
from renderer.versions import package_versions, sources_digest


class RenderThread:
    """A thread with a stage and an OpenGL context: contexts belong to threads.

    num_threads: of the software renderer, unless LP_NUM_THREADS is set. tool_versions: what the pictures depend on, by
    name: versions, and OpenGL as `GL`.
    """

    def __init__(self, content: memoryview, num_threads: int) -> None:
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="hsplat")
        try:
            self._thread.submit(self._open, content, num_threads).result()
        except BaseException:
            self._thread.shutdown()
            raise

    def _open(self, content: memoryview, num_threads: int) -> None:
        os.environ.setdefault("LP_NUM_THREADS", str(num_threads))
        self._stage = deserialize_stage(content)
        self._rasterizer = open_rasterizer(needs_opengl=self._stage.scene.needs_opengl)
        self._controller = ScheduleController(self._stage)
        self.tool_versions = package_versions() | {"GL": self._rasterizer.renderer_name}

    def draw(self, number: int) -> FrameResult:
        """Draw a frame, after those that other threads have requested."""
        return self._thread.submit(
            lambda: next(draw_locally(self._stage, [number], self._rasterizer, self._controller))
        ).result()

    def close(self) -> None:
        """Release the OpenGL context; does not wait for it."""
        self._thread.submit(self._rasterizer.release)
        self._thread.shutdown(wait=False)


class SerializedStage:
    """The bytes of a stage, as `renderer.frame.transport` writes them, and in a worker the thread that draws it.

    Dask keeps one in each worker's memory for as long as the client needs it, and the thread lives as long, even if the
    client is killed. Copies for other workers come without the thread.

    content: uint8 [num_bytes].
    """

    def __init__(self, content: npt.NDArray[np.uint8]) -> None:
        self._content, self._render_thread = content, None
        self._lock = threading.Lock()

    def __reduce__(self) -> tuple[type[SerializedStage], tuple[npt.NDArray[np.uint8]]]:
        return SerializedStage, (self._content,)

    def __sizeof__(self) -> int:
        return self._content.nbytes

    def render_thread(self, num_threads: int) -> RenderThread:
        """Return the thread; the first call starts it."""
        with self._lock:
            if self._render_thread is None:
                content = self._content if self._content.flags.writeable else self._content.copy()
                self._render_thread = RenderThread(content.data, num_threads)
                self._closing = weakref.finalize(self, self._render_thread.close)
                self._closing.atexit = False  # threads have ended by then
            return self._render_thread

    def discard_thread(self, thread: RenderThread) -> None:
        """Close a thread whose context is lost; the next call of `render_thread` starts another."""
        with self._lock:
            if self._render_thread is thread:
                self._render_thread = None
                self._closing()

    _render_thread: RenderThread | None


def describe_worker() -> dict[str, Any]:
    """Return the versions in this process, and as `sources` the digest of what draws: checkouts may share a version."""
    return package_versions() | {"sources": _sources_digest()}


# Once, for the sources that this process has loaded: a checkout may change later.
_sources_digest = functools.cache(sources_digest)


def draw_on_worker(stage_data: SerializedStage, number: int) -> tuple[bytes, dict[str, Any], dict[str, Any]]:
    """Draw a frame; return its PNG file, its record for the sidecar, and the versions that made it."""
    from distributed import get_worker

    thread = stage_data.render_thread(get_worker().state.nthreads)
    try:
        drawn = thread.draw(number)
    except ContextLostError:
        stage_data.discard_thread(thread)
        raise
    return drawn.picture.png, drawn.record, thread.tool_versions
