"""Every case still renders to its golden frames.

They are compared by `hsplat compare`: where the device is the one in golden.json, stored values must be the same, and
elsewhere the default limit holds. A report of the differences is left in `failed`.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from golden_cases import CASES, FOLDER, FRAMES, Case

from renderer.draw import BrickRasterizer, SplatRasterizer

FAILED = FOLDER / "failed"

MATCHING = [case for case in CASES if case.golden_changes is None]
(MUST_FAIL,) = (case for case in CASES if case.golden_changes is not None)


def compared(case: Case, rasterizer: SplatRasterizer, scratch: Path, report: Path) -> dict[str, Any]:
    """Compare a case; return the outcome of its film in the report."""
    (recorded,) = json.loads((case.folder / "golden.json").read_bytes())["origins"]
    is_same = recorded["device"] in (rasterizer.device, BrickRasterizer.device)
    limit = ["--limit", "same bytes"] if is_same else []
    code = case.compare(scratch, *limit, "--report", str(report), "--quiet")
    assert code in (0, 1), f"could not compare: exit code {code}"
    (film,) = json.loads((report / "report.json").read_bytes())["films"]
    assert film["name"] == case.name
    return {"passes": code == 0, **film}


@pytest.mark.parametrize("case", MATCHING, ids=str)
def test_golden(case: Case, rasterizer: SplatRasterizer, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    if not compared(case, rasterizer, tmp_path, tmp_path / "report")["passes"]:
        report = shutil.copytree(tmp_path / "report", FAILED / case.name, dirs_exist_ok=True)
        table = capsys.readouterr().out
        pytest.fail(f"{case} protects {case.protects}\n\n{table}\nit is shown in {report}/index.html", pytrace=False)


def test_the_case_that_must_fail_does(rasterizer, tmp_path, capsys) -> None:
    """Its golden was drawn half a degree further round, which moves edges by tens of steps."""
    film = compared(MUST_FAIL, rasterizer, tmp_path, tmp_path / "report")
    assert not film["passes"]
    (frame,) = film["frames"]
    assert frame["status"] == "different"
    assert 4 < frame["largest"] < 30
    change, *others = film["changes"]
    of_machine = [each for each in others if each["key"] == "device" or each["key"].startswith("version of ")]
    assert others == of_machine
    assert (change["key"], change["was"], change["now"]) == ("camera.path.start", "20.5", "20")
    assert frame["why"] in capsys.readouterr().out
    assert "camera.path.start" in (tmp_path / "report" / "index.html").read_text("utf-8")


def test_every_folder_of_goldens_belongs_to_a_case() -> None:
    assert {path.name for path in FRAMES.iterdir()} == {case.name for case in CASES}
