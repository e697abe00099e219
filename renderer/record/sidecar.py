"""Write the sidecar: the JSON file beside an output that records how it was made."""

from __future__ import annotations

import json
from pathlib import Path

from renderer.film import write_staged
from renderer.record.film_record import FilmRecord, record_to_json


def write_sidecar(path: Path, record: FilmRecord, folder: Path | None = None) -> None:
    """Write a record as JSON, whole or not at all; `folder` as in `renderer.film.write_staged`.

    Raises ValueError for numbers that JSON lacks (NaN, infinities), InputError or RenderError if the file cannot be
    written.
    """
    text = json.dumps(record_to_json(record), indent=2, ensure_ascii=False, allow_nan=False)
    # File names that are not UTF-8 have surrogates in Python, which become escapes in JSON.
    write_staged(path, f"{text}\n".encode(errors="backslashreplace"), folder)
