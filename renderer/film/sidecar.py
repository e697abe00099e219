"""The JSON file beside an output that says how it came to be."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from renderer.film.atomic import write_staged


def write_sidecar(path: Path, data: Mapping[str, Any], within: Path | None = None) -> None:
    """Write `data` as JSON, complete or not at all; `within` as for `renderer.film.atomic.staged`.

    Keys keep their order and floats their value. Paths become strings, numpy's scalars and arrays numbers and lists.
    Raises ValueError for numbers that JSON does not have (NaN, infinities), TypeError for other objects, InputError or
    RenderError when the file cannot be written.
    """
    text = json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False, default=_plain)
    # Bytes of a file name that are no UTF-8 are surrogates in Python, and become escapes that JSON has.
    write_staged(path, f"{text}\n".encode(errors="backslashreplace"), within)


def _plain(value: object) -> object:
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, (np.generic, np.ndarray)):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no form in JSON")
