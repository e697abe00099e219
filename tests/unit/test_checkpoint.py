"""A checkpoint has the frames whose files match their records, and no others."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from renderer.film import Picture, bytes_digest, data_digest, encode_png, frame_path, remove_temporaries
from renderer.job import DrawnFrame, FrameCheckpoint, remove_checkpoint_frames
from renderer.record import FilmFingerprint, FrameRecord, read_frame_record, record_to_json
from renderer.scene import OutputSpec

NUMBERS = range(4)
DEPENDS_ON = {"scene": {"size": (6, 4)}, "versions": {"numpy": "2.0"}}
OUTPUTS = ["film.mp4", "{frame}/x.png"]


def png(number: int) -> bytes:
    return encode_png(np.full((4, 6, 3), number, np.uint8))


def fingerprint(depends_on: dict[str, Any]) -> FilmFingerprint:
    return FilmFingerprint(data_digest(depends_on), {}, depends_on)


FINGERPRINT, OTHER = fingerprint(DEPENDS_ON), fingerprint({"other": 1})


def record(number: int, digest: str | None = None) -> FrameRecord:
    return FrameRecord(number, tolerance=0.1, cells=9, primitives=8, seconds={"draw": 0.5}, digest=digest)


def save(checkpoint: FrameCheckpoint, number: int) -> None:
    checkpoint.save(DrawnFrame(record(number), {0: Picture(content=png(number))}))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    path = tmp_path / "frames.unfinished"
    path.mkdir()
    return path


@pytest.fixture(params=OUTPUTS)
def output(request: pytest.FixtureRequest, tmp_path: Path) -> OutputSpec:
    return OutputSpec(tmp_path / request.param, size=(6, 4))


def reopened(folder: Path, output: OutputSpec, of: FilmFingerprint = FINGERPRINT) -> FrameCheckpoint:
    return FrameCheckpoint(folder, output, NUMBERS, of)


def keep(folder: Path, output: OutputSpec, *numbers: int) -> FrameCheckpoint:
    checkpoint = reopened(folder, output)
    for number in numbers:
        save(checkpoint, number)
    return checkpoint


def picture_of(folder: Path, output: OutputSpec, number: int) -> Path:
    is_film = output.file.suffix == ".mp4"
    return folder / f"00000{number}.png" if is_film else frame_path(output.file, number)


def test_a_checkpoint_is_read_again(folder: Path, output: OutputSpec) -> None:
    first = keep(folder, output, 0, 2)
    second = reopened(folder, output)
    assert second.records == first.records == {i: record(i, bytes_digest(png(i))) for i in (0, 2)}
    np.testing.assert_array_equal(second.finished_frame(2).pictures[0].pixels, Picture(content=png(2)).pixels)
    assert (second.former, second.num_outdated) == (None, 0)


def test_a_record_that_ends_anywhere(folder: Path, output: OutputSpec) -> None:
    keep(folder, output, 0, 1)
    path = folder / "000001.json"
    whole = path.read_bytes()
    for length in range(len(whole)):
        path.write_bytes(whole[:length])
        assert set(reopened(folder, output).records) == {0}
    path.write_bytes(whole)
    assert set(reopened(folder, output).records) == {0, 1}


@pytest.mark.parametrize(
    "garbage",
    [
        b"", b"\0" * 100, b"\xff\xfe", b"[]", b"7", b"null", b'"text"', b"{}", b"[" * 100_000,
        b'{"fingerprint":' * 100_000,
        b'{"fingerprint": {}}', b'{"fingerprint": [], "record": {}}', b'{"record": []}', b"9" * 5000, b" " * 2**21,
    ],
)  # fmt: skip
def test_a_record_of_garbage(folder: Path, output: OutputSpec, garbage: bytes) -> None:
    keep(folder, output, 0, 1)
    (folder / "000001.json").write_bytes(garbage)
    checkpoint = reopened(folder, output)
    assert set(checkpoint.records) == {0}
    save(checkpoint, 1)
    assert set(reopened(folder, output).records) == {0, 1}


@pytest.mark.parametrize(
    "change",
    [
        {"frame": -1}, {"frame": True}, {"frame": "1"}, {"frame": 1.0}, {"frame": None}, {"cells": -1},
        {"primitives": 0.5},
        {"digest": 7}, {"digest": "00"}, {"tolerance": "0.1"}, {"tolerance": -1}, {"tolerance": None},
        {"tolerance": float("nan")}, {"tolerance": float("inf")}, {"seconds": []}, {"seconds": {"draw": "1"}},
        {"seconds": {"draw": {"deep": [[[]]]}}}, {"predicted_seconds": "soon"}, {"more": 1}, {"tolerance": 10**400},
        {"device": 1}, {"blank": 1}, {"frame": 10**7},
    ],
)  # fmt: skip
def test_what_is_no_record(change: dict[str, Any]) -> None:
    whole = record_to_json(record(1, "0" * 32))
    assert read_frame_record(whole) == record(1, "0" * 32)
    for more in ({"predicted_seconds": 0.1}, {"blank": True}, {"device": "a GPU"}):
        assert record_to_json(read_frame_record(whole | more)) == whole | more
    assert read_frame_record(whole | change) is None
    for key in (change.keys() & whole.keys()) - {"digest"}:
        del whole[key]
        assert read_frame_record(whole) is None


def test_a_record_of_another_frame(folder: Path, output: OutputSpec) -> None:
    """A record counts for the frame whose number it has, if the job draws that frame."""
    keep(folder, output, 0, 1)
    data = json.loads((folder / "000001.json").read_bytes())
    for number in (0, 3, 7, 10**9):
        data["record"]["frame"] = number
        (folder / "000001.json").write_text(json.dumps(data))
        assert set(reopened(folder, output).records) == {0}


@pytest.mark.parametrize("damage", ["remove", "cut", "change", "folder", "pipe"])
def test_a_picture_that_was_changed(folder: Path, output: OutputSpec, damage: str) -> None:
    keep(folder, output, 0, 1)
    path = picture_of(folder, output, 1)
    content = path.read_bytes()
    path.unlink()
    if damage == "cut":
        path.write_bytes(content[:-1])
    elif damage == "change":
        path.write_bytes(content[:-1] + b"x")
    elif damage == "folder":
        path.mkdir()
    elif damage == "pipe":
        os.mkfifo(path)
    assert set(reopened(folder, output).records) == {0}


def test_a_picture_of_another_size(folder: Path, output: OutputSpec) -> None:
    """A file of another size, or of another kind, does not count, though somebody has made its record agree."""
    keep(folder, output, 0, 1, 2, 3)
    pictures = {number: encode_png(np.zeros(shape, np.uint8)) for number, shape in enumerate([(6, 4, 3), (4, 6, 4)])}
    for number, content in (pictures | {2: b"GIF89a" * 9}).items():
        picture, recorded = picture_of(folder, output, number), folder / f"00000{number}.json"
        picture.write_bytes(content)
        data = json.loads(recorded.read_bytes())
        data["record"]["digest"] = bytes_digest(content)
        recorded.write_text(json.dumps(data))
    assert set(reopened(folder, output).records) == {3}


def test_another_fingerprint(folder: Path, output: OutputSpec) -> None:
    keep(folder, output, 0, 1, 2)
    other = fingerprint(DEPENDS_ON | {"versions": {"numpy": "2.1"}})
    checkpoint = reopened(folder, output, other)
    assert checkpoint.records == {}
    assert checkpoint.former == {"scene": {"size": [6, 4]}, "versions": {"numpy": "2.0"}}
    assert checkpoint.num_outdated == 3
    assert list(folder.iterdir()) == []
    save(checkpoint, 1)
    again = reopened(folder, output, other)
    assert (set(again.records), again.former, again.num_outdated) == ({1}, None, 0)


def test_a_fingerprint_whose_file_is_missing(folder: Path, output: OutputSpec) -> None:
    keep(folder, output, 0, 1)
    (recorded,) = folder.glob("fingerprint-*.json")
    recorded.unlink()
    assert set(reopened(folder, output).records) == {0, 1}
    checkpoint = reopened(folder, output, OTHER)
    assert (checkpoint.records, checkpoint.former, checkpoint.num_outdated) == ({}, {}, 2)


def test_pictures_under_their_final_names_are_never_removed(folder: Path, output: OutputSpec) -> None:
    keep(folder, output, 0, 1)
    finals = [path for path in folder.parent.rglob("*.png") if path.parent != folder]
    reopened(folder, output, OTHER)
    remove_checkpoint_frames(folder, output, NUMBERS)
    assert all(path.is_file() for path in finals)
    assert len(finals) == (0 if output.file.suffix == ".mp4" else 2)


def test_jobs_with_other_frames_share_nothing(folder: Path, tmp_path: Path) -> None:
    """As two of a job array, which both are at work: neither sees nor removes what the other has."""
    output = OutputSpec(tmp_path / "{frame}.png", size=(6, 4))
    first = FrameCheckpoint(folder, output, [0, 1], FINGERPRINT)
    second = FrameCheckpoint(folder, output, [2, 3], OTHER)
    for i in (0, 1):
        save(first, i)
        save(second, i + 2)
    remove_checkpoint_frames(folder, output, [0, 1])
    assert set(FrameCheckpoint(folder, output, [2, 3], OTHER).records) == {2, 3}
    assert FrameCheckpoint(folder, output, [0, 1], OTHER).num_outdated == 0


def test_frames_of_another_fingerprint_may_stay(folder: Path, output: OutputSpec) -> None:
    keep(folder, output, 0)
    other = FrameCheckpoint(folder, output, [1, 2], OTHER)
    for number in (1, 2):
        save(other, number)
    (folder / "000003.png").write_bytes(b"no record came")
    remove_checkpoint_frames(folder, output, NUMBERS, of=FINGERPRINT)
    assert not list(folder.glob("00000[03].*"))
    assert FrameCheckpoint(folder, output, [1, 2], OTHER).records == other.records
    remove_checkpoint_frames(folder, output, NUMBERS, of=OTHER)
    assert list(folder.iterdir()) == []


def test_all_frames_of_a_film_in_one_file_are_removed(folder: Path, tmp_path: Path) -> None:
    """Also frames that it did not have, and pictures without a record; but nothing of other names."""
    output = OutputSpec(tmp_path / "film.mp4", size=(6, 4))
    keep(folder, output, 0, 1, 3)
    (folder / "000002.json").unlink(missing_ok=True)
    (folder / "000002.png").write_bytes(b"no record came")
    names = ["note.txt", "1.png", "000001.json.bak", "a000001.png", "fingerprint-mine.json", "lock"]
    for name in names:
        (folder / name).touch()
    remove_checkpoint_frames(folder, output, [0])
    assert sorted(path.name for path in folder.iterdir()) == sorted(names)


def test_adopted_records(folder: Path, output: OutputSpec) -> None:
    recorded = list(keep(folder, output, 0, 1, 2).records.values())
    for path in folder.glob("*.json"):
        path.unlink()
    picture_of(folder, output, 1).write_bytes(b"changed")
    checkpoint = reopened(folder, output)
    assert checkpoint.records == {}
    checkpoint.adopt_records(recorded)
    assert set(checkpoint.records) == {0, 2}


@pytest.mark.parametrize("step", range(40))
def test_a_kill_between_any_two_steps(folder, output: OutputSpec, monkeypatch, step: int) -> None:
    """Whatever calls of the operating system a job came to, the frames that count are whole ones."""
    before = keep(folder, output, 0)
    num_steps = 0

    class Killed(BaseException):
        pass

    def counted(function: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **options: Any) -> Any:
            nonlocal num_steps
            num_steps += 1
            if num_steps > step:
                raise Killed
            return function(*arguments, **options)

        return call

    with monkeypatch.context() as patch:
        for owner, name in ((os, "replace"), (Path, "touch"), (Path, "write_bytes"), (Path, "unlink"), (Path, "mkdir")):
            patch.setattr(owner, name, counted(getattr(owner, name)))
        try:
            save(before, 1)
            save(before, 2)
        except Killed:
            pass
    checkpoint = reopened(folder, output)
    assert 0 in checkpoint.records
    for number in checkpoint.records:
        assert checkpoint.finished_frame(number).pictures[0].content == png(number)
    remove_temporaries(folder)
    remove_checkpoint_frames(folder, output, NUMBERS)
    assert list(folder.iterdir()) == []
