"""What a user reads about films that are drawn, and drawn again."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_scene import small_scene
from transcripts import Case, cases


@cases("films.txt")
def test_messages(case: Case, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("scene.yaml").write_text(small_scene(error=""), encoding="utf-8")
    case.check(capsys)
