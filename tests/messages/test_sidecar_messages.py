"""Messages of `check` and `render` about a sidecar from which no film can be made; its film does not change."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from transcripts import Case, cases

OLD_SIDECAR = """\
{"scene": {"version": 1}, "gl": "GL 4.5", "schedule": {"asked": {"tolerance": 0.5}}, "cause": {}, "frames": []}
"""


@cases("sidecar.txt")
def test_messages(case: Case, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copy(Path(__file__).with_name("sidecar.json"), "film.mp4.json")
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
