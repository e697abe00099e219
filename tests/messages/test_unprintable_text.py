"""Text from outside reaches the terminal on one line, with every character that is not printable as an escape.

Each source writes hostile text into the current folder and returns a command that prints it. The text tries to clear
the screen, to reverse what follows, to overwrite the line, and to begin a line of its own that looks like ours.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hsplat_cli import main
from renderer.scene import parse_yaml
from tests.messages.conftest import SCAN_SCENE as SCENE
from tests.support.dicom_files import NORMAL, write_slice

HOSTILE = "a\x1b[2J\x9b\u202e\u2066\u200b\ufe0f\a\rb"
SHOWN = r"a\x1b[2J\x9b\u202e\u2066\u200b\ufe0f\x07\rb"
FAKE_LINE = "\nwritten by us"


def nrrd_data_file() -> list[str]:
    head = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\n"
    Path("scan.nhdr").write_text(f"{head}data file: {HOSTILE}.raw\n", "utf-8", newline="")
    return ["info", "scan.nhdr"]


def metaimage_data_file() -> list[str]:
    head = "NDims = 3\nDimSize = 2 2 2\nElementType = MET_UCHAR\n"
    Path("scan.mhd").write_text(f"{head}ElementDataFile = {HOSTILE}.raw\n", "utf-8", newline="")
    return ["info", "scan.mhd"]


def volume_that_is_read() -> list[str]:
    np.save(f"{HOSTILE}{FAKE_LINE}.npy", np.arange(8.0).reshape(2, 2, 2))
    return ["info", f"{HOSTILE}{FAKE_LINE}.npy"]


def volume_that_is_suggested() -> list[str]:
    np.save(f"{HOSTILE}{FAKE_LINE}.npy", np.arange(8.0).reshape(2, 2, 2))
    return ["init", f"{HOSTILE}{FAKE_LINE}.npy", "--output=scene.yaml"]


def volume_that_is_missing() -> list[str]:
    return ["info", f"{HOSTILE}{FAKE_LINE}.npy"]


def hint_at_a_volume() -> list[str]:
    Path(f"scans-of-a-foot-{HOSTILE}{FAKE_LINE}.npy").touch()
    return ["info", "scans-of-a-foot-aa written by.npy"]


def hint_in_a_scene() -> list[str]:
    Path(f"scans-of-a-foot-{HOSTILE}{FAKE_LINE}.npy").touch()
    Path("scene.yaml").write_text(SCENE.replace("scan.npy", "scans-of-a-foot-aa scene.npy"), "utf-8")
    return ["check", "scene.yaml"]


def scene_that_is_right() -> list[str]:
    np.save("scan.npy", np.zeros((2, 2, 2)))
    Path(f"{HOSTILE}{FAKE_LINE}.yaml").write_text(SCENE, "utf-8")
    return ["check", f"{HOSTILE}{FAKE_LINE}.yaml"]


def scene_that_is_wrong() -> list[str]:
    Path(f"{HOSTILE}{FAKE_LINE}.yaml").write_text("camera: [\n", "utf-8")
    return ["check", f"{HOSTILE}{FAKE_LINE}.yaml"]


def yaml_key() -> list[str]:
    Path("scene.yaml").write_text(f"{json.dumps(HOSTILE + FAKE_LINE)}: 1\n", "utf-8")
    return ["check", "scene.yaml"]


def yaml_value() -> list[str]:
    Path("scene.yaml").write_text(f"shading: {json.dumps(HOSTILE + FAKE_LINE)}\n", "utf-8")
    return ["check", "scene.yaml"]


def sidecar_field() -> list[str]:
    Path("film.json").write_text(json.dumps({"format": "hsplat film 1", HOSTILE + FAKE_LINE: 1}), "utf-8")
    return ["check", "film.json"]


def argument_too_many() -> list[str]:
    return ["check", "scene.yaml", HOSTILE + FAKE_LINE]


def option_that_does_not_exist() -> list[str]:
    return ["check", f"--{HOSTILE}{FAKE_LINE}"]


def option_of_a_wrong_type() -> list[str]:
    return ["turntable", "--frames", HOSTILE + FAKE_LINE, "scan.npy"]


def command_that_does_not_exist() -> list[str]:
    return [HOSTILE + FAKE_LINE]


def setting() -> list[str]:
    Path("scene.yaml").write_text(SCENE, "utf-8")
    return ["check", "scene.yaml", "--set", f"{HOSTILE}{FAKE_LINE}=1"]


def output() -> list[str]:
    np.save("scan.npy", np.zeros((2, 2, 2)))
    Path("scene.yaml").write_text(SCENE, "utf-8")
    return ["check", "scene.yaml", "--output", f"{HOSTILE}{FAKE_LINE}.mp4"]


def dicom_description() -> list[str]:
    for series, name in enumerate(("scan", HOSTILE)):
        for number in range(3):
            file, position = Path(f"{series}-{number}.dcm"), number * NORMAL
            write_slice(file, np.zeros((4, 4)), position, uid=f"1.2.{series}", name=name)
    return ["info", "."]


def volumes_of_a_batch() -> list[str]:
    for name in (f"a{HOSTILE}{FAKE_LINE}.npy", "b.npy"):
        Path(name).write_bytes(b"")
    return ["turntable", "--quiet", "--output=films", f"a{HOSTILE}{FAKE_LINE}.npy", "b.npy"]


def pictures_that_are_compared() -> list[str]:
    for folder in ("golden", "actual"):
        Path(folder).mkdir()
        Path(folder, f"{HOSTILE}{FAKE_LINE}.png").write_bytes(b"")
    return ["compare", "golden", "actual"]


def what_ffmpeg_prints() -> list[str]:
    for folder in ("golden", "actual"):
        Path(folder).mkdir()
        Path(folder, f"{HOSTILE}.mp4").write_bytes(b"\0\0\0\x18ftypisom" + bytes(99))
    return ["compare", f"golden/{HOSTILE}.mp4", f"actual/{HOSTILE}.mp4"]


SOURCES: list[Callable[[], list[str]]] = [
    nrrd_data_file, metaimage_data_file, volume_that_is_read, volume_that_is_suggested, volume_that_is_missing,
    hint_at_a_volume, hint_in_a_scene, scene_that_is_right, scene_that_is_wrong, yaml_key, yaml_value, sidecar_field,
    argument_too_many, option_that_does_not_exist, option_of_a_wrong_type, command_that_does_not_exist, setting,
    output, dicom_description, volumes_of_a_batch, pictures_that_are_compared, what_ffmpeg_prints,
]  # fmt: skip


@pytest.mark.parametrize("source", SOURCES, ids=lambda source: source.__name__)
def test_text_from_outside_is_printable(
    source: Callable[[], list[str]], folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    main.run(source())
    lines = "".join(capfd.readouterr()).split("\n")
    assert [line for line in lines if not line.isprintable() or "\ufe0f" in line] == []
    assert any(SHOWN[:12] in line for line in lines)
    assert not any(line.startswith("written by us") for line in lines)


def test_names_that_are_not_utf8_are_told_apart(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    shown = set()
    for name in (b"\x9b", "\x9b".encode()):
        main.run(["info", f"{os.fsdecode(name)}.npy"])
        shown.add(capfd.readouterr().err)
    assert len(shown) == 2


def test_a_traceback_is_printable(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setenv("HSPLAT_DEBUG", "1")
    assert main.run(["info", str(tmp_path / f"{HOSTILE}.npy")]) == 2
    text = capfd.readouterr().err
    assert "Traceback" in text
    assert SHOWN in text
    assert all(line.isprintable() for line in text.split("\n"))


def test_json_keeps_the_true_name(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert main.run([*volume_that_is_read(), "--json"]) == 0
    text = capfd.readouterr().out
    assert text.isascii()
    assert json.loads(text)["name"] == f"{HOSTILE}{FAKE_LINE}.npy"


def test_a_scene_on_the_standard_output_keeps_the_true_name(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    _, volume = volume_that_is_read()
    assert main.run(["init", volume]) == 0
    text = capfd.readouterr().out
    assert all(line.isprintable() for line in text.split("\n"))
    assert parse_yaml(text).data["volume"]["file"] == volume
