"""Draws frames for a pool: `hsplat_cli.executors.workers.worker SOCKET STAGE`, two file descriptors.

It sends that it is ready, and answers each `{"draw": number}` with the frame's record, its PNG file and its pixels,
which saves decoding. A lost context or an error is its last message.
"""

from __future__ import annotations

import math
import os
import socket
import sys
import time
from collections.abc import Sequence

from hsplat_cli.executors.frame_result import FrameResult, LocalExecutor
from hsplat_cli.executors.rasterizers import open_rasterizer
from hsplat_cli.executors.workers.messages import Message, error_to_plain, receive, send
from hsplat_cli.executors.workers.shared_stage import map_stage
from renderer.errors import ContextLostError, HsplatError, RenderError
from renderer.frame import Rasterizer, Stage, Stopwatch, draw_frame, make_draw_list, make_primitive


def main(arguments: Sequence[str]) -> None:
    """Draw until the pool closes the socket."""
    end, descriptor = socket.socket(fileno=int(arguments[0])), int(arguments[1])
    with end:
        try:
            _serve(end, descriptor)
        except EOFError:
            pass
        except ContextLostError as error:
            send(end, Message({"lost": error_to_plain(error)}))
        except HsplatError as error:
            send(end, Message({"error": error_to_plain(error)}))


def _serve(end: socket.socket, descriptor: int) -> None:
    stage = map_stage(descriptor)
    os.close(descriptor)
    with open_rasterizer(needs_opengl=stage.scene.needs_opengl) as rasterizer:
        _warm_up(stage, rasterizer)
        send(end, Message({"ready": rasterizer.renderer_name}))
        executor = LocalExecutor(stage, rasterizer)
        while True:
            result = _draw(executor, receive(end).content["draw"])
            send(end, Message({"drawn": result.record}, (result.picture.png, result.picture.pixels.tobytes())))


def _warm_up(stage: Stage, rasterizer: Rasterizer) -> None:
    """Draw the whole volume as one splat, to load kernels and compile shaders before the first frame."""
    watch = Stopwatch(time.perf_counter)
    lod = make_primitive(stage).make_lod(math.inf, watch.lap)
    draw_frame(stage, make_draw_list(stage, lod, 0, watch), rasterizer, watch)


def _draw(executor: LocalExecutor, number: int) -> FrameResult:
    try:
        (result,) = executor.draw([number])
    except MemoryError as error:
        raise RenderError(
            "there is not enough memory to draw it", where=f"frame {number}", hint="fewer workers need less"
        ) from error
    return result


if __name__ == "__main__":
    main(sys.argv[1:])
