"""Messages of `hsplat compare` where frames cannot be compared."""

from __future__ import annotations

import os
import shutil
import struct
from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import pytest
from message_scenes import SCENE
from png_files import noise, png_file, smooth, write_film, write_frames
from transcripts import Case, cases

ROWS = bytes(100)
# The content of frame-0000.png in folders of these names.
PICTURES = {
    "jpeg": imageio.imwrite("<bytes>", np.zeros((8, 8, 3), np.uint8), extension=".jpg"),
    "lfs": b"version https://git-lfs.github.com/spec/v1\n", "empty_file": b"", "short": png_file(16, 16, ROWS),
    "huge": png_file(100_000, 100_000, ROWS), "bits16": png_file(4, 4, ROWS, depth=16),
    "palette": png_file(4, 4, ROWS, color_type=3, more=[(b"PLTE", bytes(9))]),
    "grey": png_file(4, 4, ROWS, color_type=0), "transparent": png_file(4, 4, ROWS, more=[(b"tRNS", bytes(6))]),
    "animation": png_file(4, 4, ROWS, more=[(b"acTL", struct.pack(">II", 2, 0))]),
}  # fmt: skip
FIRST = "frame-0000.png"


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with golden/ and actual/, and with pictures, films and folders that have one fault each."""
    folder = tmp_path_factory.mktemp("files")
    frames = [noise(number) for number in range(3)]
    for name in ("golden", "actual", "some_links"):
        write_frames(folder / name, frames)
    write_frames(folder / "others", frames, "f'{:04}.png")
    write_frames(folder / "above" / "below", frames)
    write_frames(folder / "tiny", [noise(1, 8, 8)])
    write_frames(folder / "tiny_too", [noise(2, 8, 8)])
    write_frames(folder / "black", [np.zeros((16, 16, 3), np.uint8), *frames[1:]])
    content = (folder / "golden" / FIRST).read_bytes()
    damaged = {"cut": content[:-30], "damaged": content[:100] + bytes(1) + content[101:]}
    for name, of_first in {**PICTURES, **damaged}.items():
        (folder / name).mkdir()
        (folder / name / FIRST).write_bytes(of_first)
    for name in ("empty", "links", "folder", "lost", "two", "many_empty", "many_too", "composed", "decomposed"):
        (folder / name).mkdir()
    for number in range(12):
        (folder / "many_empty" / f"{number:02}.png").touch()
        (folder / "many_too" / f"{number:02}.png").touch()
    for name in ("above/notes.txt", "notes.txt", "two/frame-0000.png", "two/frame-0002.png", "empty.mp4", "scan.npy"):
        (folder / name).touch()
    (folder / "composed" / "\u00e9.png").touch()
    (folder / "decomposed" / "e\u0301.png").touch()
    (folder / "folder" / FIRST).mkdir()
    (folder / "lost" / FIRST).symlink_to("gone.png")
    (folder / "broken").symlink_to("gone")
    for number in range(3):
        (folder / "links" / f"frame-{number:04}.png").symlink_to(f"../golden/frame-{number:04}.png")
    for name in ("frame-0001.png", "frame-0002.png"):
        (folder / "some_links" / name).unlink()
        (folder / "some_links" / name).symlink_to(f"../golden/{name}")
    pictures = [smooth(number) for number in range(6)]
    for name, num in (("film", 6), ("short", 4), ("one", 1)):
        write_film(folder / f"{name}.mp4", pictures[:num])
    for suffix in ("mp4", "gif"):
        for name in ("same", "again"):
            write_film(folder / f"{name}.{suffix}", pictures)
        write_film(folder / f"changed.{suffix}", [*pictures[:4], smooth(2), pictures[5]])
    film = (folder / "film.mp4").read_bytes()
    (folder / "cut.mp4").write_bytes(film[:-50])
    (folder / "damaged.mp4").write_bytes(film[:-400] + bytes(400))
    (folder / "picture.mp4").write_bytes(content)
    for link, target in (("link.mp4", "film.mp4"), ("link", "golden"), ("link.json", "golden/golden.json")):
        (folder / link).symlink_to(target)
    (folder / "golden" / "golden.json").write_text("{}", "utf-8")
    (folder / "film.mp4.json").write_text("{}", "utf-8")
    (folder / "scene.yaml").write_text(SCENE, "utf-8")
    return folder


@pytest.fixture(autouse=True)
def folder(files: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a copy of the files, and a pipe, the current folder."""
    shutil.copytree(files, tmp_path, symlinks=True, dirs_exist_ok=True)
    os.mkfifo(tmp_path / "pipe.xml")
    monkeypatch.chdir(tmp_path)


@cases("compare.txt")
def test_messages(case: Case, files: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No command changes a file."""
    case.check(capsys)
    for path in files.rglob("*"):
        copy = Path(path.relative_to(files))
        assert os.path.lexists(copy)
        assert not path.is_file() or copy.read_bytes() == path.read_bytes()
    assert Path("pipe.xml").is_fifo()
