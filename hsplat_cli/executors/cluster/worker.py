"""What a worker of a cluster does: it gets a film's parcel once, makes a stage of it, and draws frame after frame.

Nothing here needs a file of the client's. The client imports this module, too, and so does the scheduler, which passes
its functions on by their names.
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

from hsplat_cli.executors.drawn import Drawn, LocalDrawer
from hsplat_cli.executors.rasterizers import open_rasterizer
from hsplat_cli.terminal import package_versions, sources_digest
from renderer.errors import ContextLostError
from renderer.frame import unpack


class Studio:
    """A stage and a GL context to draw it with, in a thread of their own: GL contexts belong to threads.

    num_threads: of the software renderer, unless LP_NUM_THREADS is set.
    made_with: what the pictures depend on, by name: versions, and the OpenGL as `GL`.
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
        stage = unpack(content)
        self._rasterizer = open_rasterizer(needs_opengl=stage.scene.needs_opengl)
        self._drawer = LocalDrawer(stage, self._rasterizer)
        self.made_with = package_versions() | {"GL": self._rasterizer.renderer_name}

    def draw(self, number: int) -> Drawn:
        """One frame, once those that other threads have asked for are done."""
        return self._thread.submit(lambda: next(self._drawer.draw([number]))).result()

    def close(self) -> None:
        """Let the GL context go; does not wait for it."""
        self._thread.submit(self._rasterizer.release)
        self._thread.shutdown(wait=False)


class Parcel:
    """The bytes of a stage, as `renderer.frame.transport` packs them, and in a worker the studio that draws it.

    Dask keeps one of them in each worker's memory for as long as the client needs it. So that is how long the studio
    lives, whether the client lets it go or is killed. Copies that are sent to other workers are without it.

    content: uint8 [num_bytes].
    """

    def __init__(self, content: npt.NDArray[np.uint8]) -> None:
        self._content, self._studio = content, None
        self._lock = threading.Lock()

    def __reduce__(self) -> tuple[type[Parcel], tuple[npt.NDArray[np.uint8]]]:
        return Parcel, (self._content,)

    def __sizeof__(self) -> int:
        return self._content.nbytes

    def studio(self, num_threads: int) -> Studio:
        """Made when it is first asked for."""
        with self._lock:
            if self._studio is None:
                content = self._content if self._content.flags.writeable else self._content.copy()
                self._studio = Studio(content.data, num_threads)
                self._closing = weakref.finalize(self, self._studio.close)
                self._closing.atexit = False  # when threads have ended
            return self._studio

    def give_up(self, studio: Studio) -> None:
        """Make a new one when it is asked for again."""
        with self._lock:
            if self._studio is studio:
                self._studio = None
                self._closing()

    _studio: Studio | None


def describe() -> dict[str, Any]:
    """The versions in this process, and as `sources` the digest of what draws: checkouts may have one version.

    That this can be called tells that hsplat is installed.
    """
    return package_versions() | {"sources": _sources_digest()}


# As they are when this process has loaded them: it goes on with those if a checkout is changed.
_sources_digest = functools.cache(sources_digest)


def draw(parcel: Parcel, number: int) -> tuple[bytes, dict[str, Any], dict[str, Any]]:
    """A frame's PNG file, what its film's sidecar tells of it, and what it was made with."""
    from distributed import get_worker

    studio = parcel.studio(get_worker().state.nthreads)
    try:
        drawn = studio.draw(number)
    except ContextLostError:
        parcel.give_up(studio)
        raise
    return drawn.picture.png, drawn.record, studio.made_with
