"""A machine without OpenGL draws bricks, in this process and in workers, to the same bytes."""

from __future__ import annotations

from pathlib import Path

import pytest
from commands import hsplat
from small_scene import sidecar, small_scene

from hsplat_cli.commands.paper import SCENES
from renderer.draw import GLRasterizer, is_software
from renderer.draw.gl.raster import CPU_RENDERER_NAME

# libglvnd finds no drivers here.
NO_OPENGL = {"__EGL_VENDOR_LIBRARY_FILENAMES": "/nowhere"}
FRAMES = [f"{number}.png" for number in range(5)]


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("scene.yaml").write_text(small_scene(footprint=None), encoding="utf-8")


def films(folder: str) -> dict[str, bytes]:
    return {name: (Path(folder) / name).read_bytes() for name in FRAMES}


def test_films_without_opengl() -> None:
    for workers in "1", "2":
        output = ["--output", f"{workers}/{{frame}}.png"]
        result = hsplat("render", "scene.yaml", "--workers", workers, *output, **NO_OPENGL)
        assert result.returncode == 0, result.stderr
    assert films("1") == films("2")
    assert sidecar("2/frames.json")["device"] == CPU_RENDERER_NAME


def test_other_commands_without_opengl() -> None:
    for arguments in (
        ["golden", "scene.yaml", "goldens"],
        ["compare", "scene.yaml", "goldens"],
        ["measure", "scene.yaml", "--want", "psnr=20", "--frames", "0"],
        ["render", "scene.yaml", "--progressive"],
        ["render", "scene.yaml", "--set", "overlay=octree"],
    ):
        result = hsplat(*arguments, **NO_OPENGL)
        assert result.returncode == 0, result.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ["render", "scene.yaml", "--set", "splat={footprint: gaussian}"],
        ["measure", "scene.yaml", "--footprints", "integrated,gaussian", "--output", "study"],
        ["paper", str(SCENES), "--figure", "6", "--output", "paper"],
    ],
)
def test_what_needs_opengl_is_an_error(arguments: list[str]) -> None:
    result = hsplat(*arguments, **NO_OPENGL)
    assert result.returncode == 1
    assert "no OpenGL 3.3 context could be made" in result.stderr
    assert "needs none" in result.stderr


def test_the_same_bytes_as_beside_software_opengl(rasterizer: GLRasterizer) -> None:
    if not is_software(rasterizer.device):
        pytest.skip("a GPU draws other bytes")
    for folder, variables in (("with", {}), ("without", NO_OPENGL)):
        assert hsplat("render", "scene.yaml", "--output", f"{folder}/{{frame}}.png", **variables).returncode == 0
    assert films("with") == films("without")
