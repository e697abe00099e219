"""golden.json is read as it was written, and forged content is refused."""

from __future__ import annotations

import contextlib
import copy
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hsplat_cli.compare import (
    PROVENANCE,
    PROVENANCE_FILE,
    Golden,
    Provenance,
    golden_file_name,
    origin_from_record,
    parse_date,
)
from renderer.errors import InputError
from renderer.record import FilmFingerprint, VolumeRecord

DIGEST = "0123456789abcdef" * 2

DEPENDS_ON = {
    "scene": {"error": {"tolerance": 0.1}, "output": {"size": [32, 32]}},
    "versions": {"python": "3.11.2", "numpy": "2.1.0"},
}
RECORD: Any = SimpleNamespace(  # the part of one that the origin is taken from
    scene={"volume": {"file": "/scans/engine.nhdr", "crop": None, "nodata": "auto"}, "output": {"file": "x"}},
    volume=VolumeRecord("/scans/engine.nhdr", DIGEST, "uint8", (8, 8, 4), ()),
    device="llvmpipe (LLVM 15.0.6, 256 bits)",
    fingerprint=FilmFingerprint(DIGEST, {}, DEPENDS_ON),
)
ORIGIN = origin_from_record(RECORD)
WRITTEN = Provenance(
    **vars(ORIGIN),
    frames=(Golden(0, "frame-0000.png", DIGEST, "today"), Golden(7, "frame-0007.png", DIGEST)),
)


@pytest.mark.parametrize("date", [None, "am Samstag, \u00e4hm"])
def test_what_is_written_is_read_again(tmp_path: Path, date: str | None) -> None:
    written = replace(WRITTEN, frames=(replace(WRITTEN.frames[0], date=date), WRITTEN.frames[1]))
    content = PROVENANCE.content(written)
    (tmp_path / PROVENANCE_FILE).write_bytes(content)
    assert PROVENANCE.read(tmp_path / PROVENANCE_FILE) == written
    assert PROVENANCE.content(PROVENANCE.read(tmp_path / PROVENANCE_FILE)) == content


def test_each_golden_has_its_own_line() -> None:
    lines = PROVENANCE.content(WRITTEN).decode().splitlines()
    assert lines[-5:] == [
        '  "frames": [',
        f'    {{"frame": 0, "file": "frame-0000.png", "digest": "{DIGEST}", "date": "today"}},',
        f'    {{"frame": 7, "file": "frame-0007.png", "digest": "{DIGEST}"}}',
        "  ]",
        "}",
    ]


def test_the_origin_has_no_paths() -> None:
    raw = copy.deepcopy(RECORD)
    raw.scene["volume"] = {"raw": {"file": "/scans/a.raw", "shape": [8, 8, 4]}, "nodata": "auto"}
    assert ORIGIN.volume.name == "engine.nhdr"
    assert ORIGIN.scene["volume"] == {"crop": None, "nodata": "auto"}
    assert origin_from_record(raw).scene["volume"] == {"raw": {"shape": [8, 8, 4]}, "nodata": "auto"}
    assert b"scans" not in PROVENANCE.content(replace(WRITTEN, **vars(origin_from_record(raw))))


@pytest.mark.parametrize("name", ["a\nb.npy", "\udcff.npy", "x" * 300])
def test_any_name_of_a_volume_can_be_recorded(name: str, tmp_path: Path) -> None:
    record = copy.deepcopy(RECORD)
    record.volume = replace(RECORD.volume, name=name)
    (tmp_path / PROVENANCE_FILE).write_bytes(PROVENANCE.content(replace(WRITTEN, **vars(origin_from_record(record)))))
    assert PROVENANCE.read(tmp_path / PROVENANCE_FILE).volume.name.isprintable()


def test_file_names_are_in_the_order_of_frames() -> None:
    assert [golden_file_name(7, num) for num in (120, 10_000, 10_001)] == [*["frame-0007.png"] * 2, "frame-00007.png"]


def test_changes_of_the_origin_are_described() -> None:
    moved = replace(ORIGIN, volume=replace(ORIGIN.volume, name="moved.nhdr"))
    assert ORIGIN.changes(ORIGIN) == ORIGIN.changes(moved) == ""
    now = replace(moved, scene={**ORIGIN.scene, "error": {"tolerance": 0.2}}, device="another")
    assert ORIGIN.changes(now) == f"device was '{ORIGIN.device}'; scene.error.tolerance was 0.1"
    assert ORIGIN.changes(now, "scene") == "scene.error.tolerance was 0.1"


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
def test_forged_content_is_refused(forge: Callable[[dict[str, Any]], Any], tmp_path: Path) -> None:
    data = json.loads(PROVENANCE.content(WRITTEN))
    forge(data)
    (tmp_path / PROVENANCE_FILE).write_text(json.dumps(data), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        PROVENANCE.read(tmp_path / PROVENANCE_FILE)
    assert str(caught.value).startswith(f"{tmp_path / PROVENANCE_FILE}: ")
    assert all(line.isprintable() for line in str(caught.value).splitlines())


def test_damage_never_leads_to_the_wrong_file(tmp_path: Path) -> None:
    """A file that is cut off is refused; one with a wrong byte is refused, or its content is still consistent."""
    content = PROVENANCE.content(WRITTEN)
    generator = np.random.default_rng(1)
    for position in range(len(content)):
        if position < len(content) - len("}\n"):
            (tmp_path / PROVENANCE_FILE).write_bytes(content[:position])
            with pytest.raises(InputError):
                PROVENANCE.read(tmp_path / PROVENANCE_FILE)
        changed = bytearray(content)
        changed[position] = generator.integers(256)
        (tmp_path / PROVENANCE_FILE).write_bytes(changed)
        with contextlib.suppress(InputError):
            found = PROVENANCE.read(tmp_path / PROVENANCE_FILE)
            assert [golden.file for golden in found.frames] == [
                f"frame-{golden.frame:04}.png" for golden in found.frames
            ]


def test_a_file_that_is_too_large_and_a_folder_are_not_parsed(tmp_path: Path) -> None:
    small = replace(PROVENANCE, max_bytes=1000)
    (tmp_path / PROVENANCE_FILE).write_bytes(b"{" + b" " * 1000)
    with pytest.raises(InputError, match=f"too large for a {PROVENANCE_FILE}\n  expected: at most 1000 bytes"):
        small.read(tmp_path / PROVENANCE_FILE)
    (tmp_path / PROVENANCE_FILE).unlink()
    (tmp_path / PROVENANCE_FILE).mkdir()
    with pytest.raises(InputError, match="not a file"):
        small.read(tmp_path / PROVENANCE_FILE)


def test_a_million_goldens_fit() -> None:
    longest = Golden(999_999, golden_file_name(999_999, 1_000_000), DIGEST)
    one, two = (len(PROVENANCE.content(replace(WRITTEN, frames=(longest,) * num))) for num in (1, 2))
    assert one + 1_000_000 * (two - one) < PROVENANCE.max_bytes


@pytest.mark.parametrize("text", ["", "\x1b[31m", "x" * 201])
def test_a_date_is_one_printable_line(text: str) -> None:
    with pytest.raises(InputError, match="--date: not a date"):
        parse_date(text)
