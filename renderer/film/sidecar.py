"""Write the sidecar: the JSON file beside an output that records how it was made."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from renderer.film.atomic import write_staged


def write_sidecar(path: Path, data: Mapping[str, Any], folder: Path | None = None) -> None:
    """Write `data` as JSON, whole or not at all; `folder` as in `renderer.film.atomic.staging`.

    Keys keep their order and floats their value. Paths become strings, numpy's scalars and arrays numbers and lists.
    Raises ValueError for numbers that JSON lacks (NaN, infinities), TypeError for other objects, InputError or
    RenderError if the file cannot be written.
    """
    text = json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False, default=_to_json_value)
    # File names that are not UTF-8 have surrogates in Python, which become escapes in JSON.
    write_staged(path, f"{text}\n".encode(errors="backslashreplace"), folder)


def _to_json_value(value: object) -> object:
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no form in JSON")
