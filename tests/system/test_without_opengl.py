"""A machine without OpenGL draws bricks, in this process and on a cluster, to the same bytes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from clusters import running_cluster
from commands import hsplat, python
from small_scene import sidecar, small_scene

from renderer.draw import BrickRasterizer

# libglvnd finds no drivers here.
NO_OPENGL = {"__EGL_VENDOR_LIBRARY_FILENAMES": "/nowhere"}
FRAMES = [f"{number}.png" for number in range(5)]


SCENE = small_scene()
pytestmark = pytest.mark.usefixtures("scene_folder")


def films(folder: str) -> dict[str, bytes]:
    return {name: (Path(folder) / name).read_bytes() for name in FRAMES}


@pytest.mark.slow
def test_the_same_bytes_as_beside_opengl() -> None:
    with running_cluster(2, variables=NO_OPENGL) as cluster:
        on_cluster = ["--scheduler", cluster.scheduler_address]
        for folder, options, variables in (("with", [], {}), ("without", [], NO_OPENGL), ("on", on_cluster, NO_OPENGL)):
            output = ["--output", f"{folder}/{{frame}}.png"]
            result = hsplat("render", "scene.yaml", *options, *output, **variables)
            assert result.returncode == 0, result.stderr
            assert films(folder) == films("with")
    assert sidecar("on/frames.json")["device"] == BrickRasterizer.device


def codes_without_opengl(*commands: str) -> tuple[list[int], str]:
    """Run commands in one process; return their exit codes and what they print on the error stream."""
    program = "import sys; from hsplat_cli.main import run; print([run(each.split()) for each in sys.argv[1:]])"
    done = python("-c", program, *commands, **NO_OPENGL)
    return json.loads(done.stdout.splitlines()[-1]), done.stderr


@pytest.mark.slow
def test_other_commands_without_opengl() -> None:
    codes, said = codes_without_opengl(
        "golden scene.yaml",
        "compare scene.yaml",
        "measure scene.yaml --want psnr=20 --frames 0",
        "render scene.yaml --progressive",
        "render scene.yaml --set annotation.octree=true",
    )
    assert codes == [0] * 5, said


def test_what_needs_opengl_is_an_error() -> None:
    codes, said = codes_without_opengl(
        "render scene.yaml --set splat.footprint=gaussian",
        "measure scene.yaml --thorough --footprints integrated,gaussian --output study",
    )
    assert codes == [1] * 2
    assert said.count("no OpenGL 3.3 context could be made") == said.count("needs none") == 2, said


def test_bricks_open_no_opengl() -> None:
    program = "import sys; from hsplat_cli.main import run; print([run(sys.argv[1:]), 'moderngl' in sys.modules])"
    done = python("-c", program, "render", "scene.yaml")
    assert json.loads(done.stdout.splitlines()[-1].lower()) == [0, False]
