"""Studies of `hsplat measure` that benchmarks write pages about, made once and kept where that is asked for."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hsplat_cli.main import run


def kept_study(scene: Path, volume: Path | None, folder: Path, options: Sequence[str]) -> dict[str, Any]:
    """The JSON of a study in `folder`, measured now unless it is there. volume: takes the place of the scene's."""
    path = folder / "measure.json"
    if not path.exists():
        arguments = ["measure", str(scene), "--output", str(folder), *options]
        assert run([*arguments, *(["--volume", str(volume)] if volume else [])]) == 0
    study: dict[str, Any] = json.loads(path.read_text("utf-8"))
    return study
