"""What a user reads about parts that do not make a film, and that nothing is written then."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from message_scenes import shorter_scene
from small_scene import contents, edit_sidecar, sidecar
from transcripts import Case, cases

from hsplat_cli import main
from renderer.film import bytes_digest, encode_png


@pytest.fixture(scope="module")
def template(module_folder: Path) -> Path:
    """Draw three parts of a small film of nine frames once for all cases, into parts/ of a folder."""
    Path("scene.yaml").write_text(shorter_scene(9), encoding="utf-8")
    for frames in ("0:3", "3:6", "6:9"):
        draw("--frames", frames, "--output", "parts/{frame:04}.png")
    return module_folder


def draw(*arguments: str) -> None:
    assert main.run(["render", "scene.yaml", "--quiet", *arguments]) == 0


def change(name: str, edit: Callable[[dict[str, Any]], object]) -> None:
    """Edit the sidecar of a part."""
    path = Path(f"parts/frames.{name}.json")
    before = sidecar(path)
    edit_sidecar(path, edit)
    assert sidecar(path) != before


def make_others() -> None:
    def edit(data: dict[str, Any]) -> None:
        data["scene"]["transfer_function"]["points"][1]["opacity"] = 0.5
        data["scene"]["error"]["tolerance"] = 0.2
        data["schedule"]["requested"] = {"tolerance": 0.2}

    change("3-5", edit)
    change("6-8", lambda data: data["volume"].update(fingerprint="0" * 32))


def damage_pictures() -> None:
    Path("parts/0000.png").unlink()
    Path("parts/0001.png").write_bytes(Path("parts/0001.png").read_bytes()[:-20])
    damaged = bytearray(Path("parts/0002.png").read_bytes())
    damaged[50] ^= 255
    Path("parts/0002.png").write_bytes(damaged)
    for number, shape in ((3, (16, 24, 3)), (4, (32, 32, 4)), (5, (32, 32, 3))):
        Path(f"parts/000{number}.png").write_bytes(encode_png(np.zeros(shape, np.uint8)))
    shutil.copy("parts/0008.png", "parts/0006.png")
    Path("parts/0007.png").write_bytes(b"GIF89a")


def remove_digests() -> None:
    change("0-2", lambda data: data["frames"][1].pop("digest"))
    change("3-5", lambda data: [frame.pop("digest") for frame in data["frames"]])


def draw_a_frame_twice() -> None:
    draw("--frames", "2:4", "--output", "more/{frame}.png")
    shutil.move("more/frames.2-3.json", "parts/frames.2-3.json")
    content = encode_png(np.zeros((32, 32, 3), np.uint8))
    Path("more/3.png").write_bytes(content)
    change("2-3", lambda data: data["frames"][1].update(digest=bytes_digest(content)))
    shutil.move("parts/frames.2-3.json", "more/frames.2-3.json")


def make_no_parts() -> None:
    draw("--output", "film.mp4", "--frames", "0:2")
    Path("empty").mkdir()
    Path("cut.json").write_text('{\n  "scene": {', encoding="utf-8")
    Path("other.json").write_text("{}", encoding="utf-8")
    Path("old.json").write_text('{"scene": {}, "gl": "GL 4.5"}', encoding="utf-8")
    change("0-2", lambda data: data["frames"][1].pop("cells"))
    change("3-5", lambda data: data["scene"]["camera"]["path"].update(frames=4))
    change("6-8", lambda data: data["volume"].pop("fingerprint"))


def spoil_sidecars() -> None:
    def spoil(data: dict[str, Any]) -> None:
        data |= {"pyramid": 5, "seconds": {"total": "x", "read": -1}, "notes": ["plain", {}]}
        data["versions"]["numpy"] = []
        data["schedule"] |= {"met": "yes", "shortfall": 7}

    def spoil_more(data: dict[str, Any]) -> None:
        data |= {"seconds": [], "notes": "plain"}
        data["pyramid"]["finest_level_drawn"] = None

    change("0-2", spoil)
    change("3-5", spoil_more)
    change("6-8", lambda data: data["scene"].update(error=5))


def rename_pictures() -> None:
    for part, name in (("0-2", "{frame:zz}.png"), ("3-5", "{frame:400000}.png"), ("6-8", "{frame}-{frame}.png")):
        change(part, lambda data, name=name: data["scene"]["output"].update(file=name))


# What happens before the commands of a case, by its title.
PREPARATIONS: dict[str, Callable[[], object]] = {
    "missing frames": lambda: Path("parts/frames.3-5.json").unlink(),
    "many gaps": lambda: change("0-2", lambda data: data["frames"].pop(1)),
    "parts of other films": make_others,
    "damaged pictures, which are then drawn again": damage_pictures,
    "frames without a digest, which are then drawn again": remove_digests,
    "a frame that two parts have": draw_a_frame_twice,
    "no parts": make_no_parts,
    "sidecars with values of other types": spoil_sidecars,
    "names of pictures that no scene may have": rename_pictures,
    "transparent frames in a film": lambda: draw(
        "--set", "output.background=transparent", "--output", "clear/{frame}.png"
    ),
}


@cases("assemble.txt")
def test_messages(case: Case, template: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A refused command changes no file."""
    shutil.copytree(template, folder, dirs_exist_ok=True)
    PREPARATIONS.get(case.title, lambda: None)()
    before = contents()
    case.check(capsys)
    assert contents() == before or case.title.endswith("drawn again")
