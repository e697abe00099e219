"""Write the sidecar: the JSON file beside an output that records how it was made."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from renderer.film import write_staged
from renderer.job.record import FilmRecord, record_to_json
from renderer.scene import first_output, outputs_of


def write_sidecar(path: Path, record: FilmRecord, folder: Path | None = None) -> None:
    """Write a record as JSON, whole or not at all; `folder` as in `renderer.film.write_staged`.

    It is written `without_paths` if its scene says `output.record_paths: false`. Raises ValueError for numbers that
    JSON lacks (NaN, infinities), InputError or RenderError if the file cannot be written.
    """
    write_staged(path, sidecar_content(record), folder)


def sidecar_content(record: FilmRecord) -> bytes:
    """Return the content of the sidecar of a film, as `write_sidecar` writes it."""
    data = record_to_json(record)
    if not first_output(record.scene).get("record_paths", True):
        data = without_paths(data)
    text = json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False)
    # File names that are not UTF-8 have surrogates in Python, which become escapes in JSON.
    return f"{text}\n".encode(errors="backslashreplace")


def without_paths(record: Mapping[str, Any]) -> dict[str, Any]:
    """Return the record of a film or a study, as plain data, with names in place of the paths of its files.

    Its scene has `output.record_paths: false`, so that films that are made from it have no paths either. The files of
    volumes, masks, the film and the sidecars of its parts stand in the record, and are shortened in its notes, too.
    What frames depend on has no paths, and stays as its digest needs it.
    """
    first, *others = outputs_of(record["scene"])
    outputs = [{**first, "record_paths": False}, *others]
    scene = {**record["scene"], "output": outputs if others else outputs[0]}
    volumes = [*scene.get("volumes", [scene.get("volume", {})])]
    volumes += [entry["mask"] for entry in (scene, *volumes) if "mask" in entry]
    sections = [*volumes, *(volume["raw"] for volume in volumes if "raw" in volume), *outputs]
    paths = [section.get("file") for section in sections] + [part["sidecar"] for part in record.get("parts", ())]
    found = {each for path in paths if path for each in (path if isinstance(path, list) else [path])}
    return {
        key: value if key in ("fingerprint", "frames") else shorten_paths(value, found)
        for key, value in {**record, "scene": scene}.items()
    }


def shorten_paths(value: Any, paths: Collection[str | Path]) -> Any:
    """Return plain data in which the names of these files or folders replace their paths, in every text."""
    if isinstance(value, str):
        if value in paths:  # soon found among very many, in a set
            return Path(value).name or value
        for path in sorted((path for path in map(str, paths) if path in value), key=len, reverse=True):
            value = value.replace(path, Path(path).name or path)
        return value
    if isinstance(value, Mapping):
        return {key: shorten_paths(item, paths) for key, item in value.items()}
    return [shorten_paths(item, paths) for item in value] if isinstance(value, (list, tuple)) else value
