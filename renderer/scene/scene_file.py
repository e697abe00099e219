"""Read a scene file, apply the options of the command line, and check the result.

Every problem has its location: `scene.yaml:14:13`, or the option that gave the value.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from renderer.errors import InputError
from renderer.scene.editor import SceneEditor
from renderer.scene.input_file import MAX_SCENE_BYTES, read_content, reject_volume_header
from renderer.scene.message_text import format_value
from renderer.scene.spec import Scene
from renderer.scene.yaml_tree import parse_yaml_file


def load_scene(path: Path, **changes: Any) -> Scene:
    """Return the scene in the YAML file `path`; parameters and errors as in `parse_scene_content`."""
    return parse_scene_content(read_content(path), path, **changes)


def parse_scene_content(
    content: bytes,
    path: Path,
    *,
    overrides: Sequence[str] = (),
    volume: Path | None = None,
    output: Path | None = None,
    is_single_frame: bool = False,
) -> Scene:
    """Return the scene in the content of the YAML file `path`.

    Parameters
    ----------
    overrides: `path.to.key=value`, the value in YAML. Missing mappings are created, list items are counted from 0, and
        the value null removes a key. They are applied in order, before `volume` and `output`.
    volume: replaces the volume's source, and `output` the output file; both are relative to the current folder. Volume
        files in the scene are relative to the scene file, its output file to the current folder.
    is_single_frame: only one frame of the path is drawn.

    Raises InputError if the file cannot be read, and SceneError with all problems in it, in the order of the file,
    those of the command line last.
    """
    if len(content) > MAX_SCENE_BYTES:
        raise InputError("too large for a scene", where=str(path), expected=f"at most {MAX_SCENE_BYTES} bytes")
    reject_volume_header(content, path)
    tree, lines = parse_yaml_file(content, path)
    if not isinstance(tree.data, dict):
        got = "an empty file" if tree.data is None else format_value(tree.data)
        expected = "the keys volume, transfer_function, camera and output"
        raise InputError("not a scene", where=str(path), got=got, expected=expected)
    editor = SceneEditor(tree, path, lines)
    editor.apply(overrides, volume, output)
    return editor.parse(is_single_frame=is_single_frame)
