"""What became of each volume: a table for the terminal, and turntable.json for programs."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from renderer.staging import write_staged

FILE = "turntable.json"

_COLUMNS = ("volume", "status", "kind", "frames", "splats", "seconds", "film")
_NUMBERS = ("frames", "splats", "seconds")


def write_report(folder: Path, records: Sequence[dict[str, Any]]) -> None:
    """Write turntable.json: `{"films": [...]}`, a record for each volume, complete or not at all."""
    # ASCII, so that also names with bytes that are no UTF-8 have a form.
    write_staged(folder / FILE, f"{json.dumps({'films': list(records)}, indent=2)}\n".encode())


def table(records: Sequence[dict[str, Any]]) -> str:
    """A line for each volume, in columns; of a film that failed the first line of the error."""
    rows = [list(_COLUMNS), *(_row(record) for record in records)]
    widths = [max(len(row[k]) for row in rows) for k in range(len(_COLUMNS))]
    return "\n".join(
        "  ".join(
            cell.rjust(width) if name in _NUMBERS else cell.ljust(width)
            for cell, width, name in zip(row, widths, _COLUMNS, strict=True)
        ).rstrip()
        for row in rows
    )


def _row(record: dict[str, Any]) -> list[str]:
    row = [str(record.get(name, "-")) for name in _COLUMNS]
    if record["status"] == "failed":
        row[-1] = record["error"].splitlines()[0]
    elif record["status"] != "done":
        row[-1] = "-"
    if "seconds" in record:
        row[_COLUMNS.index("seconds")] = f"{record['seconds']:.1f}"
    return [cell.replace("\n", "?") for cell in row]
