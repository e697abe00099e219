"""`hsplat explain` says what a key is, and `hsplat schema` writes all keys for editors."""

from __future__ import annotations

import numpy as np
import pytest
from transcripts import Case, cases


@cases("explain.txt")
def test_messages(case: Case, scene_folder: object, capsys: pytest.CaptureFixture[str]) -> None:
    np.save("ramp.npy", np.arange(512, dtype=np.uint16).reshape(8, 8, 8))
    case.check(capsys)
