"""golden.json may have been edited by anybody: every mistake in it is named, and none is followed."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from golden_samples import picture, record_of

from hsplat_cli.compare import GOLDEN_RECORD, Golden, GoldenPicture, golden_file_name, picture_digest
from renderer.errors import InputError

RECORD = record_of({0: picture(0), 3: picture(3)})


def read_edited(folder: Path, edit: Callable[[dict[str, Any]], object]) -> str:
    """Return the error of reading RECORD after an edit; an empty text if there is none."""
    data = json.loads(GOLDEN_RECORD.content(RECORD))
    edit(data)
    path = folder / "golden.json"
    path.write_text(json.dumps(data), "utf-8")
    try:
        GOLDEN_RECORD.read(path)
    except InputError as error:
        return str(error)
    return ""


def first(data: dict[str, Any]) -> Any:
    return data["frames"][0]["pictures"][0]


def test_a_record_is_read_as_it_was_written(tmp_path: Path) -> None:
    assert read_edited(tmp_path, lambda data: None) == ""
    assert GOLDEN_RECORD.read(tmp_path / "golden.json") == RECORD
    lines = GOLDEN_RECORD.content(RECORD).decode().splitlines()
    assert sum('"frame"' in line for line in lines) == 2, "a line of its own for each frame"


@pytest.mark.parametrize(
    ("edit", "error"),
    [
        (lambda data: data.update(format="hsplat golden 2"), "remove the folder of goldens, and make them again"),
        (lambda data: data.pop("format"), "no format"),
        (lambda data: first(data).update(file="../frame-0000.png"), "frames.0.pictures: not a file of this frame"),
        (lambda data: first(data).update(file="/etc/frame-0000.png"), "frames.0.pictures: not a file of this frame"),
        (lambda data: first(data).update(file="frame-0001.png"), "frames.0.pictures: not a file of this frame"),
        (lambda data: first(data).update(file="frame-0000.png\n"), "frames.0.pictures.0.file: not a line of text"),
        (lambda data: first(data).update(file="frame-0000-1.png"), "frames.0.pictures: not a file of this frame"),
        (lambda data: first(data).update(digest="0"), "frames.0.pictures.0.digest: not a digest"),
        (lambda data: first(data).update(origin=1), "an origin that is not in the list"),
        (lambda data: first(data).update(origin=-1), "frames.0.pictures.0.origin: out of range"),
        (lambda data: first(data).update(psnr=1e9), "frames.0.pictures.0.psnr: out of range"),
        (lambda data: first(data).update(color="red"), "frames.0.pictures.0.color: unknown key"),
        (lambda data: data["frames"][0].update(pictures=[]), "frames.0.pictures: wrong number of items"),
        (lambda data: data["frames"][0].update(pictures=[first(data)] * 10), "too many pictures"),
        (lambda data: data["frames"][0].update(pictures=[first(data)] * 2), "two pictures have the same file"),
        (lambda data: data["frames"].reverse(), "frames"),
        (lambda data: data.update(frames=[]), "frames: empty"),
        (lambda data: data.pop("selection"), "selection"),
        (lambda data: data.update(selection="::0"), "selection: not a range of frames"),
        (lambda data: data.update(selection="0:1\n"), "selection: not a range of frames"),
        (lambda data: data.update(origins=[]), "origins: wrong number of items"),
        (lambda data: data["origins"][0].update(device="a\x1b[31m"), "origins.0.device: not a line of text"),
        (lambda data: data["origins"][0]["volume"].pop("fingerprint"), "origins.0.volume.fingerprint"),
    ],
)
def test_every_mistake_is_named(tmp_path: Path, edit: Callable[[dict[str, Any]], object], error: str) -> None:
    assert error in read_edited(tmp_path, edit)


def test_names_of_files_sort_as_their_frames() -> None:
    assert golden_file_name(7, 10_001) == "frame-00007.png"
    assert golden_file_name(7, 10_000, 2) == "frame-0007-2.png"


def test_the_next_picture_takes_the_first_free_number() -> None:
    digest = picture_digest(picture(0))
    names = (None, "frame-0000.png", "frame-0000-3.png")
    golden = Golden(0, tuple(GoldenPicture(digest, 0, name) for name in names))
    assert golden.free_number == 2
    assert RECORD.frames[1].free_number == 2
    assert Golden(0, golden.pictures[:1]).free_number == 1


def test_digests_tell_shapes_apart() -> None:
    pixels = picture(0)
    assert len({picture_digest(pixels.reshape(shape)) for shape in ((8, 8, 3), (4, 16, 3), (8, 6, 4))}) == 3
