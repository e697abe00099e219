"""Draws frames for a pool: `hsplat_cli.executors.workers.worker CONNECTION STAGE`, two file descriptors.

It sends the name of its renderer when it is ready, and answers each frame number with a `FrameResult` that has pixels
and PNG file. A lost context or another error is its last message.
"""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Sequence
from multiprocessing.connection import Connection

from hsplat_cli.executors.frame_result import FrameResult, draw_locally
from hsplat_cli.executors.workers.shared_stage import map_stage
from renderer.draw import open_rasterizer
from renderer.errors import HsplatError, RenderError
from renderer.frame import (
    Rasterizer,
    ScheduleController,
    Stage,
    Stopwatch,
    draw_frame,
    make_draw_list,
    make_primitive,
)


def main(arguments: Sequence[str]) -> None:
    """Draw until the pool closes the connection."""
    with Connection(int(arguments[0])) as connection:
        try:
            _serve(connection, int(arguments[1]))
        except EOFError:
            pass
        except HsplatError as error:
            connection.send(error)


def _serve(connection: Connection, descriptor: int) -> None:
    stage = map_stage(descriptor)
    os.close(descriptor)
    with open_rasterizer(needs_opengl=stage.scene.needs_opengl) as rasterizer:
        _warm_up(stage, rasterizer)
        connection.send(rasterizer.renderer_name)
        controller = ScheduleController(stage)
        while True:
            connection.send(_draw(stage, connection.recv(), rasterizer, controller))


def _warm_up(stage: Stage, rasterizer: Rasterizer) -> None:
    """Draw the whole volume as one splat, to load kernels and compile shaders before the first frame."""
    watch = Stopwatch(time.perf_counter)
    lod = make_primitive(stage).make_lod(math.inf, watch.lap)
    draw_frame(stage, make_draw_list(stage, lod, 0, watch), rasterizer, watch)


def _draw(stage: Stage, number: int, rasterizer: Rasterizer, controller: ScheduleController) -> FrameResult:
    try:
        (result,) = draw_locally(stage, [number], rasterizer, controller)
        _ = result.picture.png  # encoded here, and not by the one process that receives all frames
    except MemoryError as error:
        raise RenderError(
            "there is not enough memory to draw it", where=f"frame {number}", hint="fewer workers need less"
        ) from error
    return result


if __name__ == "__main__":
    main(sys.argv[1:])
