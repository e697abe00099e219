"""The record of a film: written to JSON and read back, in any form of JSON; any other content raises InputError."""

from __future__ import annotations

import copy
import json
import random
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from film_stages import scheduled
from small_scene import small_tree
from spoiling import spoil

from hsplat_cli.scenes import SceneRequest, load_job
from renderer.errors import InputError
from renderer.film import film_path_of_sidecar, sidecar_path
from renderer.job import FilmJob
from renderer.record import SIDECAR as SIDECAR_FILE, FilmRecord, FrameRecord, parse_film_record
from renderer.scene import MAX_SCENE_BYTES, ErrorSpec, SplatBudget, accuracy_of, parse_scene, schedule_to_dict

pytestmark = pytest.mark.usefixtures("folder")

FINGERPRINT = {"frames_digest": "89" * 16, "encoding": {"output": {}}, "depends_on": {"sources": "cd" * 16}}
SIDECAR: dict[str, Any] = {
    "format": "hsplat film 2",
    "scene": {
        "version": 1, "volume": {"procedural": {"name": "constant", "shape": [4, 4, 4]}},
        "transfer_function": {"points": [{"value": 0, "color": [0, 0.5, 1], "opacity": 0.5}]},
        "camera": {"path": {"type": "turntable", "frames": 8}},
        "error": {"tolerance": {"0": 0.5, "3": 0.5, "4": 0.0, "7": 0.0}, "measure": "optical"},
        "output": {"file": "/once/film.mp4", "size": [48, 32], "background": [0, 0, 0]}},
    "volume": {
        "name": "procedural constant", "fingerprint": "0123456789abcdef0123456789abcdef", "dtype": "float32",
        "shape": [4, 4, 4], "world_from_index": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]},
    "camera": {"target": [1.5, 1.5, 1.5], "distance": 9.0},
    "pyramid": {"levels": 2, "bytes": 100, "finest_level_drawn": 0}, "device": "GL 4.5",
    "versions": {"python": "3.10.0", "hsplat": "0.1.0"},
    "schedule": {
        "requested": {"splats": 1000}, "tolerance": [0, 0.5], "cells": [1, 9], "met": False, "reproducible": True,
        "shortfall": "why"},
    "notes": ["Würfel"], "seconds": {"read": 0.1, "total": 1e-300}, "fingerprint": FINGERPRINT, "digest": "ef" * 16,
    "frames": [
        {"frame": frame, "tolerance": tolerance, "cells": 9, "primitives": 8, "seconds": {"draw": 0.1 + 0.2}}
        for frame, tolerance in ((1, 0.5), (4, 0.0), (7, 0.0))],
}  # fmt: skip


def load(content: str | bytes | object, name: str = "film.mp4.json", draws: Any = "film", **options: Any) -> FilmJob:
    path = Path(name)
    if not isinstance(content, (str, bytes)):
        content = json.dumps(content)
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return load_job(SceneRequest(path, **options), draws)


def parsed(data: object) -> FilmRecord:
    found = parse_film_record(json.dumps(data).encode(), Path("film.mp4.json"))
    assert found is not None
    return found


def test_a_record_is_written_and_read_back(tmp_path: Path) -> None:
    path = tmp_path / "new" / "film.mp4.json"
    SIDECAR_FILE.write(path, parsed(SIDECAR))
    content = path.read_bytes()
    keys = list(json.loads(content))
    assert json.loads(content) == SIDECAR and (keys[0], keys[-1]) == ("format", "frames")
    assert content.endswith(b"}\n") and "Würfel".encode() in content
    assert parse_film_record(content, path) == parsed(SIDECAR)
    assert [file.name for file in path.parent.iterdir()] == [path.name]
    with pytest.raises(InputError, match="is a folder"):
        SIDECAR_FILE.write(path.parent, parsed(SIDECAR))


def test_all_fields_of_a_record() -> None:
    measured = {"metric": "psnr", "frame": 4, "probes": [1, 4], "worst": 41.5}
    data = SIDECAR | {
        "schedule": SIDECAR["schedule"] | {"measured": measured, "made_from": "old.mp4.json"},
        "passes": [
            {"tolerance": [1, 1], "cells": [1, 2], "predicted_seconds": 1, "seconds": 2, "after_seconds": 3},
            {
                **{"tolerance": [0, 1], "cells": [3, 4], "predicted_seconds": 1, "seconds": 2, "after_seconds": 5},
                "difference": {"rmse": 0.1, "frames": 2, "psnr_db": 20.0}}],
        "parts": [
            {"sidecar": "a.json", "frames": [1, 4], "num_frames": 2, "seconds": {"total": 1}, "measured": measured}],
        "frames": [
            SIDECAR["frames"][0] | {
                "predicted_seconds": 1.5, "device": "x", "blank": True, "digest": "0" * 32, "visible": [0.1, 0.0]}],
        "exposure": -0.359375,
        "visibility": {
            "coverage": 0.25,
            "ranges": [{"share": 0.75, "opacity": 0.5, "high": -5.0}, {"share": 0.25, "opacity": 0.5, "low": -5.0}]},
    }  # fmt: skip
    assert json.loads(SIDECAR_FILE.content(parsed(data))) == data


def test_numbers_that_json_does_not_have_are_refused(tmp_path: Path) -> None:
    broken = replace(parsed(SIDECAR), frames=(FrameRecord(1, float("nan"), 1, 1, {}),))
    with pytest.raises(ValueError, match="not JSON compliant"):
        SIDECAR_FILE.write(tmp_path / "film.json", broken)
    assert not list(tmp_path.iterdir())


def test_a_job_is_made_from_a_record() -> None:
    job = load(SIDECAR)
    assert job.scene.error == ErrorSpec(scheduled((0, 0.5), (3, 0.5), (4, 0.0), (7, 0.0)))
    assert job.scene.output.file == Path("film.mp4")
    assert list(job.frames) == [1, 4, 7]
    assert job.requested == ErrorSpec(goal=SplatBudget(1000))
    original = job.original
    assert original is not None and original.record == parsed(SIDECAR)
    assert (original.path, original.frames_digest) == (Path("film.mp4.json"), "89" * 16)
    assert original.tools == SIDECAR["versions"] | {"device": "GL 4.5", "sources": "cd" * 16}
    assert job.repeats == "film"


def test_a_film_that_one_pass_would_not_have_made_has_no_fingerprint() -> None:
    original = load({key: value for key, value in SIDECAR.items() if key != "fingerprint"}).original
    assert original is not None and original.frames_digest is None
    assert original.tools == SIDECAR["versions"] | {"device": "GL 4.5"}


@pytest.mark.parametrize(
    ("error", "requested"),
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
def test_a_schedule_changed_by_hand_replaces_the_recorded_one(error: dict[str, Any], requested: dict[str, Any]) -> None:
    """The frames were drawn at others, by which they met what was asked for."""
    job = load(SIDECAR | {"scene": SIDECAR["scene"] | {"error": error}})
    assert schedule_to_dict(job.requested) == requested
    assert job.requested == accuracy_of(job.scene.error)
    assert job.original is not None
    assert job.repeats == "nothing"


def test_any_form_of_json_is_read() -> None:
    """Keys in another order, all in one line, a byte order mark."""
    expected = load(SIDECAR)
    assert load(json.dumps(SIDECAR, sort_keys=True)) == expected
    assert load(json.dumps(SIDECAR, indent=4).encode("utf-8-sig")) == expected


def test_a_name_that_is_no_text_is_kept() -> None:
    """On Linux a name may be any bytes."""
    job = load(json.dumps(SIDECAR), name=b"b\xff.mp4.json".decode(errors="surrogateescape"))
    assert job.scene.output.file == Path(b"b\xff.mp4".decode(errors="surrogateescape"))


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


def test_only_what_begins_as_json_may_be_large() -> None:
    large = copy.deepcopy(SIDECAR) | {"notes": ["x" * MAX_SCENE_BYTES]}
    assert load(large).scene == load(SIDECAR).scene
    with pytest.raises(InputError, match="too large for a scene"):
        load(" " * MAX_SCENE_BYTES + "x: 1")
    with pytest.raises(InputError, match="too large for a scene"):
        load(json.dumps(SIDECAR["scene"] | {"x": "x" * MAX_SCENE_BYTES}))


def test_a_larger_sidecar_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    most = MAX_SCENE_BYTES + 1000
    monkeypatch.setattr("renderer.scene.input_file.MAX_SIDECAR_BYTES", most)
    monkeypatch.setattr("renderer.record.sidecar.SIDECAR", replace(SIDECAR_FILE, max_bytes=most))
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


SCENE = parse_scene(small_tree(frames=120, output={"file": "engine.mp4"}), base=Path())


@pytest.mark.parametrize(
    ("output", "frames", "sidecar"),
    [
        ("engine.mp4", range(120), "engine.mp4.json"),
        ("engine.mp4", range(30, 60), "engine.mp4.json"),
        ("out/loop.gif", range(120), "out/loop.gif.json"),
        ("still.png", [7], "still.png.json"),
        ("frames/{frame:04}.png", range(120), "frames/frames.json"),
        ("frames/{frame:04}.png", list(range(120)), "frames/frames.json"),
        ("frames/{frame:04}.png", range(30), "frames/frames.0-29.json"),
        ("frames/{frame:04}.png", tuple(range(30, 60)), "frames/frames.30-59.json"),
        ("frames/{frame:04}.png", range(0, 120, 10), "frames/frames.0-110-by-10.json"),
        ("frames/{frame:04}.png", [7], "frames/frames.7.json"),
        ("frames/{frame:04}.png", [0, 7], "frames/frames.0-7-by-7.json"),
        ("frames/{frame:04}.png", [0, 1, 3], "frames/frames.0-3-some-62a34832.json"),
        ("frames/{frame:04}.png", [0, 2, 3], "frames/frames.0-3-some-616a5ff8.json"),
        ("out/engine_{frame}.png", range(120), "out/engine_frames.json"),
        ("out/v1.2_{frame}.png", range(120), "out/v1.2_frames.json"),
        ("out/v1.2_{frame}.png", range(9), "out/v1.2_frames.0-8.json"),
        ("out/{frame}-engine.png", range(9), "out/frames-engine.0-8.json"),
    ],
)
def test_a_sidecar_lies_beside_the_output(output: str, frames: Sequence[int], sidecar: str) -> None:
    """Of numbered frames each part of the path, here of 120 frames, has one of its own."""
    scene = replace(SCENE, output=replace(SCENE.output, file=Path(output)))
    assert sidecar_path(scene, frames) == Path(sidecar)
    assert film_path_of_sidecar(Path("new") / Path(sidecar).name, Path(output)) == Path("new") / Path(output).name


JUNK = [
    None, True, False, 0, -1, 3.5, 10**30, 1e300, -0.0, "", "x", "1e3", "\0", "\ud800", "{frame}.png", "..", ".mp4",
    [], [1], [[]], {}, {"": 1}, {"frame": 2}, {"frame": None}, {"file": 3}, {"0": 1}, {"requested": {}}, {"scene": {}},
]  # fmt: skip
KEYS = ["x", "frame", "format", "digest", ""]


def test_any_data_is_read_or_refused() -> None:
    choose = random.Random(5)
    num_refused = 0
    for _ in range(500):
        data = copy.deepcopy(SIDECAR)
        for _ in range(choose.choice([1, 1, 1, 3])):
            spoil(data, choose, JUNK, KEYS)
        options = choose.choice([{}, {"frames": "4"}, {"output": Path("a.png")}, {"overrides": ["error.splats=3"]}])
        num_refused += refuses(json.dumps(data), **options)
    assert 160 < num_refused < 500


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
