"""Write the sidecar: the JSON file beside an output that records how it was made."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from renderer.film.atomic import write_staged


def write_sidecar(path: Path, data: Mapping[str, Any], folder: Path | None = None) -> None:
    """Write `data` as JSON, whole or not at all; `folder` as in `renderer.film.atomic.staging`.

    It is written `without_paths` if its scene says `output.record_paths: false`. Keys keep their order and floats their
    value. Paths become strings, numpy's scalars and arrays numbers and lists. Raises ValueError for numbers that JSON
    lacks (NaN, infinities), TypeError for other objects, InputError or RenderError if the file cannot be written.
    """
    if not data.get("scene", {}).get("output", {}).get("record_paths", True):
        data = without_paths(data)
    text = json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False, default=_to_json_value)
    # File names that are not UTF-8 have surrogates in Python, which become escapes in JSON.
    write_staged(path, f"{text}\n".encode(errors="backslashreplace"), folder)


def without_paths(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return a record of a film or a study with names in place of the paths of its files, in its notes, too.

    Its scene has `output.record_paths: false`, so that films that are made from it have no paths either. The files of
    the volume, the film and the sidecars of its parts stand in the record. What frames depend on has no paths, and
    stays as its digest needs it.
    """
    scene = {**record["scene"], "output": {**record["scene"]["output"], "record_paths": False}}
    volume = scene["volume"]
    paths = [volume.get("file"), volume.get("raw", {}).get("file"), scene["output"]["file"]]
    paths += [part["sidecar"] for part in record.get("parts", ())]
    found = [path for path in paths if path]
    return {
        key: value if key in ("cause", "frames") else shorten_paths(value, found)
        for key, value in {**record, "scene": scene}.items()
    }


def shorten_paths(value: Any, paths: Collection[str | Path]) -> Any:
    """Return plain data in which the names of these files or folders replace their paths, in every text."""
    if isinstance(value, str):
        for path in sorted(map(str, paths), key=len, reverse=True):
            value = value.replace(path, Path(path).name or path)
        return value
    if isinstance(value, Mapping):
        return {key: shorten_paths(item, paths) for key, item in value.items()}
    return [shorten_paths(item, paths) for item in value] if isinstance(value, (list, tuple)) else value


def _to_json_value(value: object) -> object:
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no form in JSON")
