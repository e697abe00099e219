"""Forged and damaged content of golden.json is refused."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_scene import small_scene

from hsplat_cli.compare import GoldenOptions, load_reproducible_job, parse_date, update_goldens
from hsplat_cli.scenes import SceneRequest
from hsplat_cli.terminal import Reporter
from renderer.errors import InputError
from renderer.job import FilmJob

DIGEST = "0123456789abcdef" * 2
WRITTEN: dict[str, Any] = {
    "format": "hsplat golden 2",
    "volume": {"name": "engine.nhdr", "fingerprint": DIGEST, "shape": [8, 8, 4], "dtype": "uint8"},
    "device": "llvmpipe (LLVM 15.0.6, 256 bits)",
    "scene": {"error": {"tolerance": 0.1}, "output": {"size": [32, 32]}},
    "versions": {"python": "3.11.2", "numpy": "2.1.0"},
    "frames": [
        {"frame": 0, "file": "frame-0000.png", "digest": DIGEST, "date": "am Samstag, \u00e4hm"},
        {"frame": 7, "file": "frame-0007.png", "digest": DIGEST},
    ],
}
READABLE = "the folder has goldens\n  got: 2 frames"


@pytest.fixture(scope="module")
def job(tmp_path_factory: pytest.TempPathFactory) -> FilmJob:
    path = tmp_path_factory.mktemp("scene") / "scene.yaml"
    path.write_text(small_scene(), "utf-8")
    return load_reproducible_job(SceneRequest(path))


def why_refused(job: FilmJob, folder: Path, content: bytes | None = None) -> str:
    """Return the error of a command that would write goldens to a folder with this golden.json."""
    if content is not None:
        (folder / "golden.json").write_bytes(content)
    with pytest.raises(InputError) as caught:
        update_goldens(job, GoldenOptions(folder), Reporter(is_quiet=True), lambda: False)
    return str(caught.value)


def test_right_content_is_read(job: FilmJob, tmp_path: Path) -> None:
    assert READABLE in why_refused(job, tmp_path, json.dumps(WRITTEN).encode())


FORGED: list[Callable[[dict[str, Any]], Any]] = [
    lambda data: data.clear(), lambda data: data["frames"][0].update(date=""),
    lambda data: data["frames"][0].update(date="two\nlines"), lambda data: data.update(scene=[]),
    lambda data: data.update(scene={"a": json.loads(20 * "[" + 20 * "]")}),
    lambda data: data.update(versions={"numpy": 2}), lambda data: data["volume"].update(fingerprint=DIGEST.upper()),
    lambda data: data["volume"].update(shape=[1, 2]), lambda data: data["volume"].update(shape=[1, 2, -3]),
    lambda data: data.update(frames={}), lambda data: data["frames"].append(data["frames"][-1]),
    lambda data: data["frames"][0].update(frame=-1, file="frame--001.png"),
    lambda data: data["frames"][0].update(frame=10**7, file="frame-10000000.png"),
    lambda data: data["frames"][0].update(file="frame-0001.png"),
    lambda data: data["frames"][0].update(file="frame-0000.png\n"),
    lambda data: data["frames"][0].update(file="frame-\u0660\u0660\u0660\u0660.png"),
    lambda data: data["frames"][0].pop("digest"),
]  # fmt: skip


@pytest.mark.parametrize("forge", FORGED)
def test_forged_content_is_refused(forge: Callable[[dict[str, Any]], Any], job: FilmJob, tmp_path: Path) -> None:
    data = json.loads(json.dumps(WRITTEN))
    forge(data)
    message = why_refused(job, tmp_path, json.dumps(data).encode())
    assert message.startswith(f"{tmp_path / 'golden.json'}: ")
    assert all(line.isprintable() for line in message.splitlines())


def test_damaged_content_is_refused_or_read(job: FilmJob, tmp_path: Path) -> None:
    """A file that is cut off is refused; one with a wrong byte may be right."""
    content = json.dumps(WRITTEN, indent=1).encode()
    generator = np.random.default_rng(1)
    for position in range(0, len(content), 5):
        assert READABLE not in why_refused(job, tmp_path, content[:position])
        changed = bytearray(content)
        changed[position] = generator.integers(256)
        why_refused(job, tmp_path, bytes(changed))


def test_a_file_that_is_too_large_and_a_folder_are_not_parsed(job: FilmJob, tmp_path: Path) -> None:
    with (tmp_path / "golden.json").open("wb") as file:
        file.truncate(2**27 + 1)
    assert f"too large for a golden.json\n  expected: at most {2**27} bytes" in why_refused(job, tmp_path)
    (tmp_path / "golden.json").unlink()
    (tmp_path / "golden.json").mkdir()
    assert "not a file" in why_refused(job, tmp_path)


@pytest.mark.parametrize("text", ["", "\x1b[31m", "x" * 201])
def test_a_date_is_one_printable_line(text: str) -> None:
    with pytest.raises(InputError, match="--date: not a date"):
        parse_date(text)
