"""The JSON Schema that lies beside a scene, and the scene's first line, by which editors find it."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

from renderer.errors import InputError
from renderer.film import write_staged
from renderer.scene import MAX_SCENE_BYTES, SCHEMA_COMMENT, read_json_object, scene_schema

# The name of the schema, in the folder of the scenes that it is for.
SCHEMA_FILE = "hsplat.schema.json"
# The first line of a scene, from which yaml-language-server, and with it most editors, take the schema.
SCHEMA_LINE = f"# yaml-language-server: $schema={SCHEMA_FILE}\n"


@cache
def schema_content() -> bytes:
    """Return the content of the file of the schema."""
    return (json.dumps(scene_schema(), indent=1) + "\n").encode()


def write_schema(path: Path) -> None:
    """Write the schema, unless the file has it already. Raises InputError for a file that is no schema of scenes."""
    content = schema_content()
    if path.exists():
        known = read_json_object(path, MAX_SCENE_BYTES) or {}
        if known.get("$comment") != SCHEMA_COMMENT:
            hint = "move it, or give another --output"
            raise InputError("this file exists, and is no schema of scenes", where=str(path), hint=hint)
        if path.read_bytes() == content:
            return
    write_staged(path, content)
