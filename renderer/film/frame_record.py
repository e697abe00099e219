"""What is told of a frame that was drawn, wherever it is told: beside its file, or in the sidecar of its film."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from typing import Any

Record = Mapping[str, Any]

_KEYS = {"frame", "digest", "tolerance", "cells", "splats", "seconds", "predicted_seconds", "gl", "blank"}


def is_frame_record(record: Any, *, has_digest: bool = True) -> bool:
    """Whether this, read from a file that anybody may have written, is all that a film's record tells of a frame.

    That is its number as `frame`, the `digest` of its PNG file, `tolerance`, `cells`, `splats`, `seconds` by step,
    `predicted_seconds` where it was drawn on a budget of time, `gl` where it was drawn elsewhere, and `blank`, true,
    where nothing of the volume shows.

    has_digest: the digest may not be missing.
    """
    if not isinstance(record, dict):
        return False
    seconds, predicted = record.get("seconds"), record.get("predicted_seconds", 0.0)
    return (
        set(record) <= _KEYS
        and isinstance(record.get("gl", ""), str)
        and record.get("blank", True) is True
        and isinstance(record.get("digest", None if has_digest else ""), str)
        and all(type(record.get(key)) is int and record[key] >= 0 for key in ("frame", "cells", "splats"))
        and isinstance(seconds, dict)
        and all(map(_is_nonnegative_number, [record.get("tolerance"), predicted, *seconds.values()]))
    )


def _is_nonnegative_number(value: Any) -> bool:
    return type(value) in (int, float) and 0 <= value <= sys.float_info.max  # integers of JSON may be larger
