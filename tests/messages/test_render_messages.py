"""What a user reads when `hsplat render` cannot do what was asked, with which exit code; and nothing is left lying."""

from __future__ import annotations

import dataclasses
import errno
import os
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
import pytest

from hsplat_cli import main
from renderer.draw import GLRasterizer
from renderer.frame import stage as stages
from renderer.view import View, make_view

SMALL = ["--set", "camera.path.frames=6", "--set", "output.size=[32, 32]", "--set", "volume.procedural.shape=[8, 8, 8]"]
CONSTANT = ["--set", "volume.procedural.name=constant"]


class Render:
    """Runs `hsplat render` on a small variant of SCENE."""

    def __init__(self, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self._folder, self._capsys = folder, capsys

    def fails(self, *arguments: str) -> tuple[int, str]:
        """Exit code and what was said, with /scans for the current folder; no file may have come or changed."""
        before = self.files()
        outcome = self.run(*arguments)
        assert self.files() == before
        return outcome

    def run(self, *arguments: str) -> tuple[int, str]:
        """Exit code and what was said, with /scans for the current folder."""
        code = main.run(["render", "scene.yaml", *SMALL, "--quiet", *arguments])
        said = self._capsys.readouterr()
        assert said.out == ""
        return code, said.err.replace(str(self._folder), "/scans")

    def files(self) -> dict[Path, bytes]:
        return {path: path.read_bytes() for path in self._folder.rglob("*") if path.is_file()}


@pytest.fixture
def render(scene_folder: Path, capsys: pytest.CaptureFixture[str]) -> Render:
    return Render(scene_folder, capsys)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "1-3",
            "--frames: not a range of frames\n  got: '1-3'\n"
            "  expected: A:B or A:B:STEP or one number; this path has the frames 0 to 5\n",
        ),
        (
            "6",
            "--frames: no frame is in this range\n  got: '6'\n"
            "  expected: A:B or A:B:STEP or one number; this path has the frames 0 to 5\n",
        ),
        (
            "4:2",
            "--frames: no frame is in this range\n  got: '4:2'\n"
            "  expected: A:B or A:B:STEP or one number; this path has the frames 0 to 5\n",
        ),
        ("::-1", "--frames: frames go forward\n  got: '::-1'\n  expected: a step of at least 1\n"),
        (
            "9" * 5000,
            f"--frames: not a range of frames\n  got: '{'9' * 56}...\n"
            "  expected: A:B or A:B:STEP or one number; this path has the frames 0 to 5\n",
        ),
    ],
    ids=["no range", "too large", "empty", "backward", "huge"],
)
def test_frames(render: Render, text: str, message: str) -> None:
    assert render.fails("--frames", text) == (2, message)


def test_several_wrong_options_at_once(render: Render) -> None:
    assert render.fails("--set", "camera.distnace=3", "--volume", "scan.nrdd", "--output", "a.png") == (
        2,
        "--set camera.distnace=3: camera.distnace: unknown key\n"
        "  expected: path, projection, field_of_view, target, distance or near\n"
        "  hint: did you mean distance?\n"
        "--volume scan.nrdd: volume.file: no such file\n"
        "  got: /scans/scan.nrdd\n"
        "  expected: an NRRD, MetaImage, NIfTI, TIFF or .npy file, or a folder of DICOM or TIFF slices\n"
        "  hint: did you mean scan.nrrd?\n"
        "--output a.png: output.file: frames need a number in their names\n"
        "  got: 'a.png'\n"
        "  expected: a .mp4 or .gif, frames such as frames/{frame:04}.png or, for one frame (--frames 7), still.png\n"
        "  hint: write a-{frame:04}.png\n",
    )


def test_a_pipe_for_a_volume(render: Render, scene_folder: Path) -> None:
    os.mkfifo(scene_folder / "pipe.nrrd")
    assert render.fails("--volume", "pipe.nrrd") == (
        2,
        "--volume pipe.nrrd: volume.file: neither a file nor a folder\n"
        "  got: /scans/pipe.nrrd\n"
        "  expected: an NRRD, MetaImage, NIfTI, TIFF or .npy file, or a folder of DICOM or TIFF slices\n"
        "  hint: write a pipe's content to a file\n",
    )


@pytest.mark.parametrize("output", ["film.mp4", "film.gif", "{frame}.png"])
def test_a_volume_that_is_cut_short(render: Render, output: str) -> None:
    np.save("scan.npy", np.zeros((8, 9, 10), np.float32))
    content = Path("scan.npy").read_bytes()
    Path("scan.npy").write_bytes(content[:-100])
    assert render.fails("--volume", "scan.npy", "--output", output) == (
        2,
        "/scans/scan.npy: the file is shorter than its header says\n"
        "  got: 2780 bytes of voxels\n"
        "  expected: 2880 bytes (8 x 9 x 10 values of float32)\n"
        "  hint: the file is truncated\n",
    )


def test_voxels_that_are_not_numbers(render: Render) -> None:
    values = np.zeros((3, 4, 5), np.float32)
    values[1, 2, 3], values[2, 0, 0] = np.nan, np.inf
    np.save("scan.npy", values)
    assert render.fails("--volume", "scan.npy") == (
        2,
        "/scans/scan.npy: 2 of 60 voxels are NaN or infinite\n"
        "  got: the first at voxel x, y, z = 3, 2, 1\n"
        "  expected: finite values\n"
        "  hint: `nonfinite: lowest` replaces them with the lowest finite value\n",
    )


def test_a_folder_in_the_place_of_the_film(render: Render, scene_folder: Path) -> None:
    (scene_folder / "film.mp4").mkdir()
    assert render.fails("--output", "film.mp4") == (
        2,
        "film.mp4: the output is a folder\n  expected: the name of a file\n",
    )


FULL = "the disk is full\n  hint: free some space, or write to another disk\n"


def test_a_disk_that_is_full_while_frames_are_written(render: Render, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(path: Path, content: bytes) -> int:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    monkeypatch.setattr(Path, "write_bytes", refuse)
    assert render.fails(*CONSTANT, "--output", "{frame}.png") == (1, f"0.png: {FULL}")


@pytest.mark.parametrize("output", ["film.mp4", "film.gif"])
def test_a_disk_that_is_full_while_a_film_is_written(
    render: Render,
    scene_folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path_factory: pytest.TempPathFactory,
    output: str,
) -> None:
    program = tmp_path_factory.mktemp("bin") / "ffmpeg"
    program.write_text("#!/bin/sh\ncat > /dev/null\necho 'No space left on device' >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(program))
    before = render.files()
    assert render.run(*CONSTANT, "--output", output) == (1, f"{output}: {FULL}")
    kept = {Path(f"{output}.unfinished/00000{i}.{suffix}") for i in range(6) for suffix in ("json", "png")}
    kept |= {path.relative_to(scene_folder) for path in scene_folder.glob("*.unfinished/cause-*.json")}
    assert {path.relative_to(scene_folder) for path in render.files().keys() - before.keys()} == kept


def test_no_opengl(render: Render, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(**options: object) -> None:
        raise Exception("libEGL.so not loaded")  # what its loader raises

    monkeypatch.setattr(moderngl, "create_context", refuse)
    for needs_it in ("splat={footprint: gaussian}", "overlay=octree"):
        assert render.fails("--set", needs_it) == (
            1,
            "no OpenGL 3.3 context could be made\n"
            "  got: libEGL.so not loaded\n"
            "  expected: an EGL library and a driver: a GPU's, or Mesa's software renderer\n"
            "  hint: on Debian or Ubuntu: apt-get install libegl1 libgl1 libgl1-mesa-dri; "
            "the footprint integrated, without an overlay, needs none\n",
        )


def test_a_picture_too_large_for_the_device(render: Render, monkeypatch: pytest.MonkeyPatch) -> None:
    def huge(*arguments: Any) -> View:  # beyond what a scene may ask for, so that every device refuses it
        return dataclasses.replace(make_view(*arguments), size=(10**6, 8))

    monkeypatch.setattr(stages, "make_view", huge)
    monkeypatch.setattr(GLRasterizer, "renderer_name", "llvmpipe")
    assert render.fails(*CONSTANT, "--set", "splat.footprint=gaussian") == (
        1,
        "llvmpipe: the device has no room for a picture of this size, or its context was lost\n"
        "  got: 1000000 x 8 pixels of 16 bytes\n"
        "  hint: choose a smaller output.size\n",
    )
