"""Check the name of a report before the work on it begins."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from hsplat_cli.reports.html import require_own_page
from renderer.errors import InputError
from renderer.film import WrittenFiles
from renderer.scene import MAX_SIDECAR_BYTES, read_json_object

# Allowed suffixes of each report, by its option. No frame or scene file has them, so that a typing mistake overwrites
# no such file.
_SUFFIXES = {"--json": (".json",), "--output": (".html", ".htm")}


def require_report_name(option: str, path: Path, inputs: Iterable[Path]) -> None:
    """Raise InputError if a name has a wrong suffix, or belongs to an input, a sidecar or another page.

    option: `--json` for a report in JSON, `--output` for a page.
    """
    where, suffixes = f"{option} {path}", _SUFFIXES[option]
    if path.suffix.lower() not in suffixes:
        got = f"a {path.suffix} file" if path.suffix else "no suffix"
        raise InputError("not a name for a report", where=where, got=got, expected=f"a {suffixes[0]} file")
    if os.path.exists(path) and not os.path.isfile(path):  # a device, or a pipe
        got = "a folder" if os.path.isdir(path) else "a special file"
        raise InputError("a report cannot replace this", where=where, got=got)
    WrittenFiles([path]).require_harmless(inputs)
    if option == "--output":
        require_own_page(path)
    elif "scene" in (read_json_object(path, MAX_SIDECAR_BYTES) or {}):
        raise InputError(
            "this report would overwrite the record of a scene",
            where=where,
            got="the JSON file of a film, of goldens or of a study",
            hint="give the report another name",
        )
