"""Functions with a fault, which a worker of a cluster calls in place of `draw_on_worker`.

Workers import it by its name, from the folders where the test's process looks for modules.
"""

from __future__ import annotations

from typing import Any

from hsplat_cli.executors import draw_on_worker
from renderer.errors import InputError
from renderer.system import MemoryShare

FRAME = 3  # the one that things happen at


def input_error(stage_data: Any, number: int, memory: MemoryShare) -> tuple[bytes, dict[str, Any], dict[str, Any]]:
    if number == FRAME:
        raise InputError("a bad frame", where="scene.yaml", got="this", expected="that", hint="another")
    return draw_on_worker(stage_data, number, memory)
