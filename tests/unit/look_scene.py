"""The smallest scene, with a transfer function to be tested."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from renderer.scene import Scene, parse_scene


def look_scene(transfer_function: dict[str, Any]) -> Scene:
    """Return a scene with this section. Raises SceneError if it is wrong."""
    tree = {
        "volume": {"procedural": {"name": "constant", "shape": [4, 4, 4]}},
        "transfer_function": transfer_function,
        "camera": {"path": {"type": "turntable", "frames": 1}},
        "output": {"file": "still.png"},
    }
    return parse_scene(tree, base=Path(), is_single_frame=True)
