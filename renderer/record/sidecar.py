"""The sidecar: the JSON file beside an output, which records how the film was made."""

from __future__ import annotations

import re
from pathlib import Path

from renderer.errors import InputError
from renderer.record.film_record import FilmRecord
from renderer.record.record_file import RecordFile
from renderer.scene import MAX_SIDECAR_BYTES, may_be_json, schema

SIDECAR = RecordFile(
    schema.dataclass_field(FilmRecord),
    noun="a sidecar",
    max_bytes=MAX_SIDECAR_BYTES,
    format_line="hsplat film 2",
    hint="render its scene again; it stands under `scene` in this file, and can be saved as a .json file of its own",
)

# The beginning of a sidecar. A file with this beginning is a sidecar, even if it is damaged further on.
_RECORD_START = re.compile(rb'(\xef\xbb\xbf)?\s*\{\s*"(format|scene)"\s*:')


def parse_film_record(content: bytes, path: Path) -> FilmRecord | None:
    """Return the record in the content of a file; None for content that is no record of a film.

    Raises InputError for a record of another version or a damaged one, and SceneError with all problems in a record.
    """
    if not may_be_json(content):
        return None
    try:
        data = SIDECAR.load(content, path)
    except InputError:
        if len(content) > SIDECAR.max_bytes or _RECORD_START.match(content):
            raise
        return None  # it may be a scene in YAML; the YAML parser accepts it, or tells the line of a mistake
    return SIDECAR.from_json(data, path) if {"scene", "format"} & data.keys() else None
