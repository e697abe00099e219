"""Every case still renders to its golden frames.

They are compared by `hsplat compare`, at `same-machine` where the driver is the one in golden.json, and at
`cross-driver` elsewhere. A page that shows the differences is left in `failed`.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from golden_cases import CASES, FOLDER, FRAMES, Case

from hsplat_cli.compare import PROVENANCE, PROVENANCE_FILE
from renderer.draw import BrickRasterizer, SplatRasterizer

FAILED = FOLDER / "failed"

MATCHING = [case for case in CASES if case.golden_changes is None]
(MUST_FAIL,) = (case for case in CASES if case.golden_changes is not None)


def compared(case: Case, rasterizer: SplatRasterizer, folder: Path) -> dict[str, Any]:
    """Compare a case; return the command's JSON, and write `page.html` in the folder."""
    is_same = PROVENANCE.read(case.folder / PROVENANCE_FILE).device in (rasterizer.device, BrickRasterizer.device)
    options = ["--level", "same-machine" if is_same else "cross-driver", "--quiet"]
    options += ["--json", str(folder / "result.json"), "--html", str(folder / "page.html")]
    code = case.compare(folder, *options)
    assert code in (0, 1), f"could not compare: exit code {code}"
    result: dict[str, Any] = json.loads((folder / "result.json").read_bytes())
    assert result["passes"] == (code == 0)
    return result


@pytest.mark.parametrize("case", MATCHING, ids=str)
def test_golden(case: Case, rasterizer: SplatRasterizer, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    if not compared(case, rasterizer, tmp_path)["passes"]:
        FAILED.mkdir(exist_ok=True)
        page = shutil.copy(tmp_path / "page.html", FAILED / f"{case}.html")
        table = capsys.readouterr().out
        pytest.fail(f"{case} protects {case.protects}\n\n{table}\nit is shown in {page}", pytrace=False)


def test_the_case_that_must_fail_does(rasterizer, tmp_path, capsys) -> None:
    """Its golden was drawn half a degree further round, which moves edges by tens of steps."""
    result = compared(MUST_FAIL, rasterizer, tmp_path)
    assert not result["passes"]
    assert result["counts"]["different"] == len(result["frames"]) == 1
    (frame,) = result["frames"]
    assert {"largest", "densest"} <= set(frame["exceeded"])
    assert 4 < frame["figures"]["largest"] < 30
    assert frame["why"].startswith("largest error of a channel ")
    assert any("camera.path.start was 20.5" in note for note in result["notes"]), result["notes"]
    assert frame["why"] in capsys.readouterr().out
    assert "frame-0000.png" in (tmp_path / "page.html").read_text("utf-8")


def test_every_folder_of_goldens_belongs_to_a_case() -> None:
    assert {path.name for path in FRAMES.iterdir()} == {case.name for case in CASES}
