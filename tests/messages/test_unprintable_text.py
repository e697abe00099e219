"""Text from outside reaches the terminal on one line, with every character that is not printable as an escape.

The text tries to clear the screen, to reverse what follows, to overwrite the line, and to begin a line of its own that
looks like ours.
"""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from dicom_files import dicom_bytes, image_fields
from message_scenes import SCAN_SCENE as SCENE
from volume_files import in_memory, written

from hsplat_cli import main
from renderer.scene import parse_yaml

HOSTILE = "a\x1b[2J\x9b\u202e\u2066\u200b\ufe0f\a\rb"
SHOWN = r"a\x1b[2J\x9b\u202e\u2066\u200b\ufe0f\x07\rb"
LINES = f"{HOSTILE}\nwritten by us"
NPY, SCAN, FOOT = f"{LINES}.npy", "scan.npy", f"scans-of-a-foot-{LINES}.npy"


def series(name: str, uid: str) -> dict[str, bytes]:
    axes = {"ImageOrientationPatient": ["1", "0", "0", "0", "1", "0"], "SeriesDescription": name}
    return {
        f"{uid}-{k}.dcm": dicom_bytes(
            image_fields(np.zeros((4, 4), np.int16), uid=uid, ImagePositionPatient=["0", "0", f"{k}"], **axes)
        )
        for k in range(3)
    }


ARRAY = in_memory(np.save, np.arange(8.0).reshape(2, 2, 2))
NRRD = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\ndata file: "
META = "NDims = 3\nDimSize = 2 2 2\nElementType = MET_UCHAR\nElementDataFile = "
FILM = b"\0\0\0\x18ftypisom" + bytes(99)
# Files, and a command that prints text of theirs.
SOURCES: dict[str, tuple[dict[str, str | bytes], list[str]]] = {
    "data file of NRRD": ({"scan.nhdr": f"{NRRD}{HOSTILE}.raw\n"}, ["info", "scan.nhdr"]),
    "data file of MetaImage": ({"scan.mhd": f"{META}{HOSTILE}.raw\n"}, ["info", "scan.mhd"]),
    "volume that is read": ({NPY: ARRAY}, ["info", NPY]),
    "volume that is suggested": ({NPY: ARRAY}, ["init", NPY, "--output=scene.yaml"]),
    "volume that is missing": ({}, ["info", NPY]),
    "hint at a volume": ({FOOT: b""}, ["info", "scans-of-a-foot-aa written by.npy"]),
    "hint in a scene": (
        {FOOT: b"", "scene.yaml": SCENE.replace(SCAN, "scans-of-a-foot-aa scene.npy")}, ["check", "scene.yaml"]),
    "scene that is right": ({SCAN: ARRAY, f"{LINES}.yaml": SCENE}, ["check", f"{LINES}.yaml"]),
    "scene that is wrong": ({f"{LINES}.yaml": "camera: [\n"}, ["check", f"{LINES}.yaml"]),
    "key": ({"scene.yaml": f"{json.dumps(LINES)}: 1\n"}, ["check", "scene.yaml"]),
    "value": ({"scene.yaml": f"shading: {json.dumps(LINES)}\n"}, ["check", "scene.yaml"]),
    "sidecar": ({"film.json": json.dumps({"format": "hsplat film 2", LINES: 1})}, ["check", "film.json"]),
    "argument too many": ({}, ["check", "scene.yaml", LINES]), "no option": ({}, ["check", f"--{LINES}"]),
    "option of a wrong type": ({}, ["turntable", "--frames", LINES, SCAN]), "no command": ({}, [LINES]),
    "setting": ({"scene.yaml": SCENE}, ["check", "scene.yaml", "--set", f"{LINES}=1"]),
    "output": ({SCAN: ARRAY, "scene.yaml": SCENE}, ["check", "scene.yaml", "--output", f"{LINES}.mp4"]),
    "description of DICOM": ({**series("scan", "1.2.3"), **series(HOSTILE, "1.2.4")}, ["info", "."]),
    "batch": ({f"a{NPY}": b"", "b.npy": b""}, ["turntable", "--quiet", "--output=films", f"a{NPY}", "b.npy"]),
    "pictures": ({f"golden/{LINES}.png": b"", f"actual/{LINES}.png": b""}, ["compare", "golden", "actual"]),
    "words of ffmpeg": (
        {f"golden/{HOSTILE}.mp4": FILM, f"actual/{HOSTILE}.mp4": FILM},
        ["compare", f"golden/{HOSTILE}.mp4", f"actual/{HOSTILE}.mp4"]),
}  # fmt: skip


def prepare(source: str) -> list[str]:
    """Write the files, and return the command."""
    files, command = SOURCES[source]
    for name, content in files.items():
        Path(name).parent.mkdir(exist_ok=True)
        written(Path(name), content.encode() if isinstance(content, str) else content)
    return command


@pytest.mark.parametrize("source", SOURCES)
def test_text_from_outside_is_printable(source: str, folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    main.run(prepare(source))
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


def test_a_traceback_is_printable(monkeypatch, capfd, tmp_path) -> None:
    monkeypatch.setenv("HSPLAT_DEBUG", "1")
    assert main.run(["info", str(tmp_path / f"{HOSTILE}.npy")]) == 2
    text = capfd.readouterr().err
    assert "Traceback" in text
    assert SHOWN in text
    assert all(line.isprintable() for line in text.split("\n"))


def test_json_keeps_the_true_name(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    assert main.run([*prepare("volume that is read"), "--json"]) == 0
    text = capfd.readouterr().out
    assert text.isascii()
    assert json.loads(text)["name"] == NPY


def test_a_scene_on_the_standard_output_keeps_the_true_name(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    _, volume = prepare("volume that is read")
    assert main.run(["init", volume]) == 0
    text = capfd.readouterr().out
    assert all(line.isprintable() for line in text.split("\n"))
    assert parse_yaml(text).data["volume"]["file"] == volume
