"""Compares pictures that a test makes, as `hsplat compare` does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hsplat_cli.compare import ReportFiles, compare_frames
from hsplat_cli.scenes import SceneRequest
from hsplat_cli.terminal import Reporter
from renderer.film import Pixels, encode_png

Pictures = Mapping[str, Pixels]


def compare_files(
    golden: Path, actual: Path, level: str | None = None, limits: Sequence[str] = (), **reports: Path
) -> Any:
    """Return the comparison of two files or folders. reports: files to write, by the names of their options."""
    files = ReportFiles({f"--{name}": path for name, path in reports.items()})
    request, reporter = SceneRequest(golden), Reporter(is_quiet=True)
    return compare_frames(request, actual, files, level=level, limits=limits, reporter=reporter)


def write_pictures(folder: Path, pictures: Pictures) -> Path:
    """Write pictures by the names of their files, into a new folder."""
    folder.mkdir()
    for name, pixels in pictures.items():
        (folder / name).write_bytes(encode_png(pixels))
    return folder


def compare_pictures(
    folder: Path,
    golden: Pictures,
    actual: Pictures,
    limits: Mapping[str, float | str] | None = None,
    level: str = "exact",
    **reports: Path,
) -> Any:
    """Return the comparison of two sets of pictures, which are written to golden/ and actual/ in an empty folder."""
    sides = [write_pictures(folder / name, side) for name, side in (("golden", golden), ("actual", actual))]
    return compare_files(*sides, level, [f"{name}={limit}" for name, limit in (limits or {}).items()], **reports)
