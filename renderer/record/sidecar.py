"""Read and write the sidecar: the JSON file beside an output that records how it was made."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from renderer.errors import InputError
from renderer.film import write_staged
from renderer.record.film_record import FORMAT, FilmRecord, record_from_json, record_to_json
from renderer.scene import MAX_SIDECAR_BYTES, decode_utf8, format_value, load_json_object, may_be_json

# Keys of records before they had a format, and their names now.
_FORMER_KEYS = {"cause": "fingerprint", "gl": "device"}
_RECORD_START = re.compile(rb'(\xef\xbb\xbf)?\s*\{\s*"(format|scene)"\s*:')


def write_sidecar(path: Path, record: FilmRecord, folder: Path | None = None) -> None:
    """Write a record as JSON, whole or not at all; `folder` as in `renderer.film.write_staged`.

    Raises ValueError for numbers that JSON lacks (NaN, infinities), InputError or RenderError if the file cannot be
    written.
    """
    text = json.dumps(record_to_json(record), indent=2, ensure_ascii=False, allow_nan=False)
    # File names that are not UTF-8 have surrogates in Python, which become escapes in JSON.
    write_staged(path, f"{text}\n".encode(errors="backslashreplace"), folder)


def parse_film_record(content: bytes, path: Path) -> FilmRecord | None:
    """Return the record in the content of a file; None for content that is no record of a film.

    Raises InputError, or SceneError with all problems, where it is one of another version, or is damaged.
    """
    if not may_be_json(content):
        return None
    if len(content) > MAX_SIDECAR_BYTES:
        raise InputError("too large for a sidecar", where=str(path), expected=f"at most {MAX_SIDECAR_BYTES} bytes")
    try:
        data = load_json_object(decode_utf8(content, path), path, kind="a sidecar")
    except InputError:
        if _RECORD_START.match(content):
            raise
        return None  # the YAML parser accepts more, and tells the line
    if not {"scene", "format"} & data.keys():
        return None
    if data.get("format") != FORMAT:
        raise _format_error(data, path)
    return record_from_json(data, path)


def _format_error(data: Mapping[str, Any], path: Path) -> InputError:
    """Return the error for a record of another version of hsplat, with the keys that have other names now."""
    former = [f"{before}, which is called {now} now" for before, now in _FORMER_KEYS.items() if before in data]
    got = f"format {format_value(data['format'])}" if "format" in data else "; ".join(["no format", *former])
    hint = "render its scene again; it stands under `scene` in this file, and can be saved as a .json file of its own"
    what = "a sidecar of another version of hsplat"
    return InputError(what, where=str(path), got=got, expected=f"format {FORMAT!r}", hint=hint)
