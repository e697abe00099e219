"""What `check` and `render` print about a sidecar from which no film can be made; its film does not change."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.support.transcripts import Case, cases

FRAMES = ",\n".join(
    f'    {{"frame": {i}, "tolerance": 0.5, "cells": 8, "primitives": 8, "seconds": {{"draw": 1}}}}' for i in range(6)
)
SIDECAR = f"""\
{{
  "format": "hsplat film 1",
  "scene": {{
    "version": 1,
    "volume": {{"procedural": {{"name": "constant", "shape": [8, 8, 8]}}}},
    "transfer_function": {{"points": [{{"value": 0, "color": [0, 0.5, 1], "opacity": 0.5}}]}},
    "camera": {{"path": {{"type": "turntable", "frames": 6}}}},
    "error": {{"tolerance": 0.5}},
    "output": {{"file": "film.mp4", "size": [32, 32]}}
  }},
  "volume": {{
    "name": "procedural constant",
    "fingerprint": "0123456789abcdef0123456789abcdef",
    "dtype": "uint8",
    "shape": [8, 8, 8],
    "world_from_index": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
  }},
  "camera": {{"target": [3.5, 3.5, 3.5], "distance": 20}},
  "pyramid": {{"levels": 3, "bytes": 100, "finest_level_drawn": 0}},
  "device": "GL 4.5",
  "versions": {{"python": "3.10.0"}},
  "schedule": {{
    "requested": {{"tolerance": 0.5}}, "tolerance": [0.5, 0.5], "cells": [8, 8], "met": true, "reproducible": true
  }},
  "notes": [],
  "seconds": {{"total": 1}},
  "frames": [
{FRAMES}
  ]
}}
"""
OLD_SIDECAR = """\
{"scene": {"version": 1}, "gl": "GL 4.5", "schedule": {"asked": {"tolerance": 0.5}}, "cause": {}, "frames": []}
"""


@cases("sidecar.txt")
def test_messages(case: Case, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("film.mp4.json").write_text(SIDECAR, encoding="utf-8")
    Path("film.mp4").write_bytes(b"a film")
    Path("old.json").write_text(OLD_SIDECAR, encoding="utf-8")
    Path("levels.json").write_bytes(b'{"scene": ' + b"[" * 200_000)
    Path("bytes.json").write_bytes(b'{"scene": {\n"output": "\xff"}}')
    Path("huge.json").write_bytes(b'{"scene": {"version": %s}}' % (b"9" * 5000))
    np.save("other.npy", np.zeros((8, 8, 8), np.uint8))
    before = sorted(folder.iterdir())
    case.check(capsys)
    assert sorted(folder.iterdir()) == before
    assert Path("film.mp4").read_bytes() == b"a film"
