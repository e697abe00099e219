"""What `check` and `render` print about a sidecar from which no film can be made; its film does not change."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.support.transcripts import Case, cases

SIDECAR = """\
{
  "scene": {
    "version": 1,
    "volume": {"procedural": {"name": "constant", "shape": [8, 8, 8]}},
    "transfer_function": {"points": [{"value": 0, "color": [0, 0.5, 1], "opacity": 0.5}]},
    "camera": {"path": {"type": "turntable", "frames": 6}},
    "error": {"tolerance": 0.5},
    "output": {"file": "film.mp4", "size": [32, 32]}
  },
  "volume": {"fingerprint": "0123456789abcdef0123456789abcdef"},
  "gl": "GL 4.5",
  "versions": {"python": "3.10.0"},
  "schedule": {"asked": {"tolerance": 0.5}},
  "frames": [
    {"frame": 0, "tolerance": 0.5},
    {"frame": 1, "tolerance": 0.5},
    {"frame": 2, "tolerance": 0.5},
    {"frame": 3, "tolerance": 0.5},
    {"frame": 4, "tolerance": 0.5},
    {"frame": 5, "tolerance": 0.5}
  ]
}
"""


@cases("sidecar.txt")
def test_messages(
    case: Case, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("film.mp4.json").write_text(SIDECAR, encoding="utf-8")
    Path("film.mp4").write_bytes(b"a film")
    Path("levels.json").write_bytes(b'{"scene": ' + b"[" * 200_000)
    Path("bytes.json").write_bytes(b'{"scene": {\n"output": "\xff"}}')
    Path("huge.json").write_bytes(b'{"scene": {"version": %s}}' % (b"9" * 5000))
    np.save("other.npy", np.zeros((8, 8, 8), np.uint8))
    before = sorted(tmp_path.iterdir())
    case.check(capsys)
    assert sorted(tmp_path.iterdir()) == before
    assert Path("film.mp4").read_bytes() == b"a film"
