"""A sidecar is read with all that a film needs, in any form of JSON; any other content raises InputError."""

from __future__ import annotations

import copy
import json
import random
from pathlib import Path
from typing import Any

import pytest

from hsplat_cli.scenes import Job, load_job, sidecar_file
from renderer.errors import InputError
from renderer.film import film_path_of_sidecar
from renderer.scene import MAX_SCENE_BYTES, ErrorSpec, input_file

SIDECAR: dict[str, Any] = {
    "scene": {
        "version": 1,
        "volume": {"procedural": {"name": "constant", "shape": [4, 4, 4]}},
        "transfer_function": {"points": [{"value": 0, "color": [0, 0.5, 1], "opacity": 0.5}]},
        "camera": {"path": {"type": "turntable", "frames": 8}},
        "error": {"tolerance": {"0": 0.5, "3": 0.5, "4": 0.0, "7": 0.0}, "measure": "optical"},
        "output": {"file": "/once/film.mp4", "size": [48, 32], "background": [0, 0, 0]},
    },
    "volume": {"name": "procedural constant", "fingerprint": "0123456789abcdef0123456789abcdef"},
    "gl": "GL 4.5",
    "versions": {"python": "3.10.0", "hsplat": "0.1.0"},
    "cause": {"frames": "89" * 16, "film": "ab" * 16, "of": {}},
    "schedule": {"asked": {"splats": 1000}, "tolerance": [0, 0.5], "cells": [1, 9], "met": False, "shortfall": "why"},
    "notes": [],
    "seconds": {"read": 0.1},
    "frames": [{"frame": 1, "tolerance": 0.5}, {"frame": 4, "tolerance": 0.0}, {"frame": 7, "tolerance": 0.0}],
}


def load(content: str | bytes | object, name: str = "film.mp4.json", **options: Any) -> Job:
    path = Path(name)
    if not isinstance(content, (str, bytes)):
        content = json.dumps(content)
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return load_job(path, **options)


@pytest.mark.usefixtures("folder")
def test_a_sidecar_holds_what_its_film_was_made_from() -> None:
    job = load(SIDECAR)
    assert job.scene.error == ErrorSpec(((0, 0.5), (3, 0.5), (4, 0.0), (7, 0.0)))
    assert job.scene.output.file == Path("film.mp4")
    assert list(job.frames) == [1, 4, 7]
    assert job.requested_error == {"splats": 1000}
    assert job.original is not None
    assert job.original.path == Path("film.mp4.json")
    assert job.original.fingerprint == "0123456789abcdef0123456789abcdef"
    assert job.original.other_schedule_keys == {"met": False, "shortfall": "why"}
    assert job.original.tool_versions == {"python": "3.10.0", "hsplat": "0.1.0", "GL": "GL 4.5"}
    assert job.original.frames_fingerprint == "89" * 16


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("cause", "sources"),
    [
        ({"of": {"sources": "cd" * 16}}, {"sources": "cd" * 16}),
        *(
            (cause, {})
            for cause in (None, 7, [], {}, {"frames": ["89"], "of": None}, {"of": ["sources"]}, {"of": {"sources": 7}})
        ),
    ],
)
def test_a_cause_may_be_incomplete(cause: Any, sources: dict[str, str]) -> None:
    job = load(SIDECAR | {"cause": cause})
    assert job.original is not None
    assert job.original.tool_versions == {"python": "3.10.0", "hsplat": "0.1.0", "GL": "GL 4.5"} | sources
    assert job.original.frames_fingerprint is None


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize(
    ("error", "asked"),
    [
        ({"tolerance": 0.5}, {"tolerance": 0.5}),
        (
            {"tolerance": {"0": 0.5, "3": 0.5, "4": 0, "6": 0, "7": 1}},
            {"tolerance": {0: 0.5, 3: 0.5, 4: 0, 6: 0, 7: 1}},
        ),
        ({"splats": 1000}, {"splats": 1000}),
        ({}, {"tolerance": 0.1}),
    ],
)
def test_a_schedule_changed_by_hand_replaces_the_recorded_one(error: dict[str, Any], asked: dict[str, Any]) -> None:
    """The frames were drawn at others, by which they met what was asked for."""
    job = load(SIDECAR | {"scene": SIDECAR["scene"] | {"error": error}})
    assert job.requested_error == asked
    assert job.original is not None
    assert job.original.other_schedule_keys == job.original.tool_versions == {}


@pytest.mark.usefixtures("folder")
def test_any_form_of_json_is_read() -> None:
    """Keys in another order, all in one line, a byte order mark, numbers that are whole."""
    expected = load(SIDECAR)
    assert load(json.dumps(SIDECAR, sort_keys=True)) == expected
    assert load(json.dumps(SIDECAR, indent=4).encode("utf-8-sig")) == expected
    assert load(json.dumps(SIDECAR).replace('"frame": 4', '"frame": 4.0')) == expected


@pytest.mark.usefixtures("folder")
def test_a_name_that_is_no_text_is_kept() -> None:
    """On Linux a name may be any bytes."""
    job = load(json.dumps(SIDECAR), name=b"b\xff.mp4.json".decode(errors="surrogateescape"))
    assert job.scene.output.file == Path(b"b\xff.mp4".decode(errors="surrogateescape"))


@pytest.mark.usefixtures("folder")
def test_a_scene_in_json_is_a_scene() -> None:
    """As YAML, with lines and columns."""
    scene = json.dumps(SIDECAR["scene"], indent=2)
    job = load(scene)
    assert job.original is None
    assert list(job.frames) == list(range(8))
    assert job.scene.output.file == Path("/once/film.mp4")
    with pytest.raises(InputError, match=r"film.mp4.json:29:17: camera.path.frames: not a whole number"):
        load(scene.replace('"frames": 8', '"frames": "8 of them"'))
    assert load(scene.replace('"frames": 8', "frames: 8,")) == job, "YAML is less strict"


@pytest.mark.usefixtures("folder")
def test_only_what_begins_as_json_may_be_large() -> None:
    large = copy.deepcopy(SIDECAR) | {"notes": ["x" * MAX_SCENE_BYTES]}
    assert load(large) == load(SIDECAR)
    with pytest.raises(InputError, match="too large for a scene"):
        load(" " * MAX_SCENE_BYTES + "x: 1")
    with pytest.raises(InputError, match="too large for a scene"):
        load(json.dumps(SIDECAR["scene"] | {"x": "x" * MAX_SCENE_BYTES}))


@pytest.mark.usefixtures("folder")
def test_a_larger_sidecar_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    most = MAX_SCENE_BYTES + 1000
    for module in (input_file, sidecar_file):
        monkeypatch.setattr(module, "MAX_SIDECAR_BYTES", most)
    text = json.dumps(SIDECAR)
    assert load(text.ljust(most)) == load(text)
    with pytest.raises(InputError, match="too large for a sidecar"):
        load(text.ljust(most + 1))


@pytest.mark.parametrize(
    ("sidecar", "recorded", "film"),
    [
        ("film.mp4.json", "film.mp4", "film.mp4"),
        ("new/film.mp4.json", "/old/film.mp4", "new/film.mp4"),
        ("film.json", "film.mp4", "film.mp4"),
        ("best.json", "film.gif", "best.gif"),
        ("best.MP4.json", "film.mp4", "best.MP4"),
        ("v1.2.json", "film.mp4", "v1.2.mp4"),
        ("still.png.json", "old/still.png", "still.png"),
        ("new/frames.json", "old/{frame:04}.png", "new/{frame:04}.png"),
        ("new/best.json", "old/a_{frame}.png", "new/a_{frame}.png"),
    ],
)
def test_the_film_lies_beside_its_sidecar(sidecar: str, recorded: str, film: str) -> None:
    assert film_path_of_sidecar(Path(sidecar), Path(recorded)) == Path(film)


@pytest.mark.usefixtures("folder")
def test_a_file_that_was_cut_off_is_refused() -> None:
    text = json.dumps(SIDECAR, indent=2)
    for end in range(len('{\n  "scene":'), len(text) - 1, 7):
        with pytest.raises(InputError):
            load(text[:end])


JUNK = [
    None, True, False, 0, -1, 3.5, 10**30, 1e300, -0.0, "", "x", "1e3", "\0", "\ud800", "{frame}.png", "..", ".mp4",
    [], [1], [[]], {}, {"": 1}, {"frame": 2}, {"frame": None}, {"file": 3}, {"0": 1}, {"asked": {}}, {"scene": {}},
]  # fmt: skip


@pytest.mark.usefixtures("folder")
def test_any_data_is_read_or_refused() -> None:
    choose = random.Random(5)
    num_refused = 0
    for _ in range(500):
        data = copy.deepcopy(SIDECAR)
        for _ in range(choose.choice([1, 1, 1, 3])):
            spoil(data, choose)
        options = choose.choice([{}, {"frames": "4"}, {"output": Path("a.png")}, {"overrides": ["error.splats=3"]}])
        num_refused += refuses(json.dumps(data), **options)
    assert 160 < num_refused < 500


@pytest.mark.usefixtures("folder")
def test_any_text_is_read_or_refused() -> None:
    choose = random.Random(6)
    text = json.dumps(SIDECAR)
    snippets = [
        "{", "}", "[", "]", ",", ":", '"', "NaN", "-Infinity", "1e999", "9" * 5000, "\\", "\\ud800", "\n", "\x00",
        '{"scene":', '"scene":1,', "[" * 5000, '{"a":' * 5000, "\ufeff", "é", "-", "0", ".", "e5",
    ]  # fmt: skip
    for _ in range(400):
        begin = choose.randrange(len(text))
        spoilt = text[:begin] + choose.choice(snippets) + text[begin + choose.choice([0, 0, 1, 9]) :]
        refuses(spoilt)
    for _ in range(200):
        content = bytearray(text.encode())
        content[choose.randrange(len(content))] = choose.randrange(256)
        refuses(bytes(content))


def spoil(data: Any, choose: random.Random) -> None:
    """Replace, remove or add something somewhere in the data."""
    while True:
        keys = list(data) if isinstance(data, dict) else list(range(len(data)))
        if not keys:
            return
        key = choose.choice(keys)
        if isinstance(data[key], (dict, list)) and data[key] and choose.random() < 0.8:
            data = data[key]
            continue
        if choose.random() < 0.2:
            del data[key]
        else:
            data[key] = copy.deepcopy(choose.choice(JUNK))
        return


def refuses(content: str | bytes, **options: Any) -> bool:
    try:
        load(content, **options)
    except InputError as error:
        text = str(error)
    else:
        return False
    assert text
    assert "INVALID" not in text
    assert "Problem(" not in text
    return True
