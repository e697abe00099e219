"""Make the scene of many tests: a procedural engine block that is drawn in a moment."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from renderer.scene import parse_yaml

# The section `error` of most scenes: exact rays of the default number take more time than all else of a small film.
FEW_PROBES = "probes: 16"


def small_scene(
    *,
    shape: str = "24, 24, 12",
    frames: int = 5,
    size: str = "32, 32",
    error: str = FEW_PROBES,
    footprint: str | None = None,
    volume: str | None = None,
) -> str:
    """Return the YAML of a turntable that is written to film.mp4.

    error: the contents of the section `error`, such as `tolerance: 0.1`. footprint: the footprint in the section
    `splat`; None for no such section. volume: the contents of the section `volume`; None for an engine block.
    """
    sections = f"error: {{{error}}}\n" if error else ""
    sections += "" if footprint is None else f"splat: {{footprint: {footprint}}}\n"
    volume = volume or f"procedural: {{name: engine_block, shape: [{shape}]}}"
    return f"""\
volume: {{{volume}}}
transfer_function:
  points:
    - {{value: 50, color: "#000000", opacity: 0.0}}
    - {{value: 90, color: "#6680e6", opacity: 0.1}}
    - {{value: 255, color: "#ffffff", opacity: 0.7}}
camera:
  path: {{type: turntable, frames: {frames}, elevation: 20}}
{sections}output:
  file: film.mp4
  size: [{size}]
"""


def small_tree(*, frames: int = 8, **sections: Any) -> dict[str, Any]:
    """Return `small_scene` as plain data for `parse_scene`. sections: sections to add, or to replace as a whole."""
    tree: dict[str, Any] = parse_yaml(small_scene(frames=frames)).data  # type: ignore[assignment]
    return tree | sections


def engine_block(*shape: int, **more: Any) -> dict[str, Any]:
    """Return the section `volume` of a scene for a procedural engine block."""
    return {"procedural": {"name": "engine_block", "shape": list(shape)} | more}


def sidecar(path: str | Path = "film.mp4.json") -> dict[str, Any]:
    """Return the data of a sidecar, or of another JSON file."""
    data: dict[str, Any] = json.loads(Path(path).read_text(encoding="utf-8"))
    return data


def edit_sidecar(path: str | Path, edit: Callable[[dict[str, Any]], object]) -> None:
    """Change the data of a sidecar, or of another JSON file, by a function, and write it back."""
    data = sidecar(path)
    edit(data)
    Path(path).write_text(json.dumps(data), encoding="utf-8")


def contents() -> dict[Path, bytes]:
    """Return the content of every file below the current folder, by path."""
    return {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}
