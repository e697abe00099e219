"""`doctor` says what is there, what is missing, and how it is installed."""

from __future__ import annotations

import json
import re
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest

from hsplat_cli import main
from hsplat_cli.commands.doctor import EXTRAS

ROOT = Path(__file__).resolve().parents[2]


def examine(capsys: pytest.CaptureFixture[str], code: int, *arguments: str) -> dict[str, Any]:
    """Run doctor, and return what it found; `parts` has its parts by their names."""
    assert main.run(["doctor", "--json", *arguments]) == code
    out, err = capsys.readouterr()
    assert err == ""
    found: dict[str, Any] = json.loads(out)
    assert found["can_draw"] is (code == 0)
    return found | {"parts": {part["name"]: part for part in found["needed"] + found["optional"]}}


def test_where_the_tests_run_films_can_be_drawn(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    found = examine(capsys, 0, "--cache", str(tmp_path / "none"))
    assert {"kernels", "ffmpeg", "numpy", "click"} <= {part["name"] for part in found["needed"] if part["found"]}
    assert found["parts"]["opengl"]["found"]
    assert found["cache"] == {"folder": str(tmp_path / "none"), "exists": False, "bytes": 0}
    assert not list(tmp_path.iterdir())
    assert found["room"]["processors"] >= 1 and found["room"]["disk"] > 0


def test_all_that_is_missing_has_the_line_that_installs_it(capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    wanted = [
        *("numpy>=99", "no-such-package>=1.5"),
        *('h5py>=3.7; extra == "hdf5"', 'h5py>=3; extra == "test"', 'no-gdcm>=3; extra == "dicom"'),
    ]
    monkeypatch.setattr(metadata, "requires", lambda _: wanted)
    monkeypatch.setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/nowhere")
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", "/nowhere/ffmpeg")
    parts = examine(capsys, 1)["parts"]
    assert parts["numpy"]["problem"].endswith("older than 99")
    assert parts["numpy"]["remedy"] == "pip install 'numpy>=99'"
    assert parts["no-such-package"]["problem"] == "not installed"
    assert parts["hdf5"]["found"] and not parts["hdf5"]["problem"]
    assert parts["dicom"]["problem"] == "no-gdcm not installed"
    assert parts["dicom"]["remedy"] == "pip install 'hsplat[dicom]'"
    assert "OpenGL" in parts["opengl"]["problem"] and "apt-get install libegl1" in parts["opengl"]["remedy"]
    assert "ffmpeg" in parts["ffmpeg"]["problem"]
    assert main.run(["doctor"]) == 1
    text = capsys.readouterr().out
    assert "\nfilms cannot be drawn\n" in text
    missing = r"\n  dicom +MISSING: no-gdcm not installed \(compressed DICOM files\)\n +pip install 'hsplat\[dicom\]'\n"
    assert re.search(missing, text)


def test_films_can_be_drawn_without_the_package_that_calls_opengl(capsys, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(metadata, "requires", lambda _: ["moderngl>=5.10; platform_machine == 'x86_64'"])
    monkeypatch.setitem(sys.modules, "moderngl", None)
    parts = examine(capsys, 0)["parts"]
    assert "moderngl" not in parts
    assert parts["opengl"]["problem"] == "the package moderngl is not installed"
    assert parts["opengl"]["remedy"] == "pip install 'hsplat[splats]'"


def test_each_extra_for_users_is_known() -> None:
    """And the extra for tests has all of them; the one for the site is left out, which takes time to install."""
    text = (ROOT / "pyproject.toml").read_text("utf-8")
    table = text.partition("[project.optional-dependencies]\n")[2].partition("\n[")[0]
    extras = {*EXTRAS, "splats"}  # OpenGL is a part of its own
    assert set(re.findall(r"(?m)^(\w+) = ", table)) - {"docs", "test", "dev"} == extras
    assert set(table.partition('"hsplat[')[2].partition("]")[0].split(",")) == extras
