"""turntable.json: what several commands, one after the other or at once, tell of the films of a folder."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from hsplat_cli.executors import ExecutorSpec
from hsplat_cli.films import Film
from hsplat_cli.scenes import FilmOptions, SuggestedScene
from hsplat_cli.terminal import Reporter
from hsplat_cli.turntable import FilmRequest, batch, manifest as manifest_module, one_film, run_batch, update_manifest
from hsplat_cli.turntable.manifest import MANIFEST_FILE, open_manifest
from hsplat_cli.turntable.one_film import write_scene
from renderer.errors import InputError, RenderError
from renderer.scene import FileSource, VolumeSpec

CODE = Path(manifest_module.__file__).parents[2]
WRITTEN: dict[str, Any] = {"scene_of": "../scan.npy", "scene_digests": ["0" * 32]}


def record(name: str, status: str = "done", **more: Any) -> dict[str, Any]:
    return {"volume": f"{name}.npy", "scene": f"out/{name}.yaml", "film": f"out/{name}.mp4", "status": status, **more}


def films(folder: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads((folder / MANIFEST_FILE).read_bytes())["films"]
    return found


def test_records_of_other_films_stay_while_their_scenes_do(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").touch()
    first = [record("a", **WRITTEN), record("b", **WRITTEN), record("c", "failed")]
    update_manifest(tmp_path, first)
    assert films(tmp_path) == first  # of the command's own, all, whatever there is
    update_manifest(tmp_path, [record("d")])
    assert films(tmp_path) == [first[0], first[2], record("d")]
    update_manifest(tmp_path, [record("a", "failed", error="it did")])
    assert films(tmp_path) == [first[2], record("d"), {**WRITTEN, **record("a", "failed", error="it did")}]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.yaml", MANIFEST_FILE]


def test_records_without_scenes_stay_while_their_volumes_do(tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "out"
    folder.mkdir(parents=True)
    (tmp_path / "link").symlink_to(folder)  # what is relative to the folder is so without links
    (tmp_path / "a.npy").touch()
    failed = [record(name, "failed", error="it did", scene_of=f"../../{name}.npy") for name in "ab"]
    update_manifest(tmp_path / "link", failed)
    update_manifest(tmp_path / "link", [record("c")])
    assert films(folder) == [failed[0], record("c")]
    (tmp_path / "a.npy").unlink()
    update_manifest(folder, [record("d")])
    assert films(folder) == [record("c"), record("d")]


def test_a_scene_stays_known_as_it_was_when_a_film_fails(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").touch()
    update_manifest(tmp_path, [record("a", **WRITTEN)])
    update_manifest(tmp_path, [record("a", "failed", error="it did", scene_of="another.npy")])
    assert films(tmp_path) == [record("a", "failed", error="it did", **WRITTEN)]


def test_what_was_not_begun_changes_nothing(tmp_path: Path) -> None:
    """Nor what was interrupted before: what is told of the film that is there holds."""
    update_manifest(tmp_path, [record("a", frames=3), record("b", "failed"), record("c", "begun")])
    update_manifest(tmp_path, [record(name, "not begun") for name in "abcd"])
    assert films(tmp_path) == [record("a", frames=3), record("b", "failed"), record("c", "begun")]
    update_manifest(tmp_path, [record(name, "interrupted") for name in "abcd"])
    assert films(tmp_path) == [record("a", frames=3), record("b", "failed"), record("c", "interrupted")]
    update_manifest(tmp_path / "new", [record("a", "interrupted"), record("b", "not begun")])
    assert list((tmp_path / "new").iterdir()) == []


WRITER = """
import sys
from pathlib import Path
from hsplat_cli.turntable.manifest import update_manifest
for number in range(10):
    name = f"{sys.argv[2]}-{number}"
    scene = f"out/{name}.yaml"
    update_manifest(Path(sys.argv[1]), [{"volume": name, "scene": scene, "film": name, "status": "done"}])
"""


def test_several_processes_lose_nothing(tmp_path: Path) -> None:
    arguments = [sys.executable, "-c", WRITER, str(tmp_path / "new")]
    environment = os.environ | {"PYTHONPATH": str(CODE)}
    processes = [subprocess.Popen([*arguments, str(number)], env=environment) for number in range(4)]
    assert [process.wait() for process in processes] == [0] * 4
    expected = {f"{process}-{number}" for process in range(4) for number in range(10)}
    assert {film["volume"] for film in films(tmp_path / "new")} == expected
    assert [path.name for path in (tmp_path / "new").iterdir()] == [MANIFEST_FILE]


HOLDER = """
import sys
from pathlib import Path
from hsplat_cli.turntable.manifest import open_manifest
with open_manifest(Path(sys.argv[1])):
    print(flush=True)
    sys.stdin.read()
"""


@pytest.mark.parametrize("lock_timeout_s", [0.0, 0.2])
def test_nobody_waits_for_ever(
    lock_timeout_s: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(manifest_module, "_NOTICE_DELAY_S", 0.1)
    arguments = [sys.executable, "-c", HOLDER, str(tmp_path)]
    environment = os.environ | {"PYTHONPATH": str(CODE)}
    with subprocess.Popen(arguments, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"\n"
        with pytest.raises(RenderError) as caught:
            update_manifest(tmp_path, [record("a")], lock_timeout_s)
        process.communicate(b"")
    holder, file = f"process {process.pid} on {os.uname().nodename}", tmp_path / MANIFEST_FILE
    assert str(caught.value) == (
        f"{file}: another process is changing this file\n  got: {holder}\n"
        "  hint: end that process, or let it finish; the same command makes only what is missing"
    )
    assert capsys.readouterr().err == (f"{file}: waiting for {holder}\n" if lock_timeout_s else "")
    update_manifest(tmp_path, [record("a")], 0.0)
    assert films(tmp_path) == [record("a")]


GOOD = record("a", **WRITTEN)

# What is there, none of which this program has written.
FORGED = {
    "nothing": b"",
    "no JSON": b"\xff\xfe{",
    "cut off": json.dumps({"films": [GOOD]}).encode()[:-3],
    "no object": b"[1]",
    "no films": b"{}",
    "an object of films": b'{"films": {"a": 1}}',
    "a number for a record": b'{"films": [1]}',
    "deep": b'{"films":' + 100_000 * b"[",
    "deep in a record": json.dumps({"films": [GOOD]}).replace('"done"', 500 * "[" + 500 * "]").encode(),
    "long digits": b'{"films": [' + 5000 * b"9" + b"]}",
    "no scene": json.dumps({"films": [{key: GOOD[key] for key in GOOD if key != "scene"}]}).encode(),
    "a number for a scene": json.dumps({"films": [GOOD | {"scene": 1}]}).encode(),
    "not a number": json.dumps({"films": [GOOD | {"seconds": float("nan")}]}).encode(),
    "infinity": json.dumps({"films": [GOOD]}).replace('"done"', '"done", "seconds": 1e999').encode(),
    "a text of digests": json.dumps({"films": [GOOD | {"scene_digests": "0"}]}).encode(),
    "numbers for digests": json.dumps({"films": [GOOD | {"scene_digests": [0]}]}).encode(),
    "half of what was written": json.dumps({"films": [record("a", scene_digests=["0" * 32])]}).encode(),
}


@pytest.mark.parametrize("case", FORGED)
def test_what_is_damaged_counts_for_nothing(case: str, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").touch()
    (tmp_path / MANIFEST_FILE).write_bytes(FORGED[case])
    with open_manifest(tmp_path) as manifest:
        assert manifest.written_scene(Path("a.yaml")) is None
    update_manifest(tmp_path, [record("b")])
    assert films(tmp_path) == [record("b")]


def test_what_is_damaged_takes_nothing_else_with_it(tmp_path: Path) -> None:
    """Nor does what somebody else has added."""
    (tmp_path / "a.yaml").touch()
    good = [GOOD | {"rating": [4, {"of": 5}], "checked": None}, record("b")]
    broken: list[Any] = [
        1,
        None,
        record("c", seconds=float("nan")),
        record("d", scene_digests="0"),
        {"scene": "e.yaml"},
        [[]],
    ]
    content = {"title": "scans", "films": [good[0], *broken, good[1]], "deep": json.loads(50 * "[" + 50 * "]")}
    (tmp_path / MANIFEST_FILE).write_text(json.dumps(content | {"odd": float("inf")}), encoding="utf-8")
    update_manifest(tmp_path, [record("f")])
    assert json.loads((tmp_path / MANIFEST_FILE).read_bytes()) == {"films": [*good, record("f")], "title": "scans"}


def test_names_of_any_kind(tmp_path: Path) -> None:
    forged = [GOOD | {"scene": scene} for scene in ("\ud800.yaml", "a\0.yaml", "..", "", "/", "a" * 300)]
    (tmp_path / MANIFEST_FILE).write_text(json.dumps({"films": forged}), encoding="utf-8")
    update_manifest(tmp_path, [record("b")])
    assert films(tmp_path)[-1] == record("b")


def test_what_is_too_large_counts_for_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    update_manifest(tmp_path, [record("a")])
    monkeypatch.setattr(manifest_module, "_MAX_BYTES", 50)
    update_manifest(tmp_path, [record("b")])
    assert films(tmp_path) == [record("b")]


def test_something_else_of_that_name(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / MANIFEST_FILE)
    update_manifest(tmp_path, [record("b")])
    assert films(tmp_path) == [record("b")]
    (tmp_path / "folder" / MANIFEST_FILE).mkdir(parents=True)
    with pytest.raises(InputError, match="the output is a folder"):
        update_manifest(tmp_path / "folder", [record("b")])


def order(folder: Path, volume: str = "scan.npy", *, force: bool = False) -> FilmRequest:
    (folder / volume).touch()
    spec, executor = VolumeSpec(FileSource(folder / volume)), ExecutorSpec(None, None)
    return FilmRequest(
        spec, FilmOptions(), None, folder / "out" / "scan.yaml", folder / "out" / "scan.mp4", executor, force
    )


def orders(folder: Path, *names: str) -> list[FilmRequest]:
    one = order(folder.parent)
    return [replace(one, scene=folder / f"{name}.yaml", output=folder / f"{name}.mp4") for name in names]


def test_a_batch_that_is_interrupted_keeps_what_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupt(*arguments: object) -> None:
        raise KeyboardInterrupt

    films_there = [record(name, frames=3) for name in "abc"]
    update_manifest(tmp_path, films_there)
    monkeypatch.setattr(batch, "_make_in_process", interrupt)
    with pytest.raises(KeyboardInterrupt):
        run_batch(orders(tmp_path, "a", "b", "c"), {}, tmp_path, Reporter(is_quiet=True))
    assert films(tmp_path) == films_there
    assert [line.split()[1:3] for line in capsys.readouterr().out.splitlines()[1:]] == [
        ["interrupted", "-"],
        ["not", "begun"],
        ["not", "begun"],
    ]


def test_a_batch_writes_what_it_has_to_tell_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What could not be written is with the next film; then the record may be one of another command."""
    fails = [True, False, False]

    def made(order: FilmRequest, options: object) -> dict[str, Any]:
        if order.scene.name == "c.yaml":
            assert [film["status"] for film in films(tmp_path)] == ["done", "done"]
            update_manifest(tmp_path, [record("a", "failed", error="another command's")])
        return order.record("done")

    def write(folder: Path, records: list[dict[str, Any]], lock_timeout_s: float) -> None:
        if fails.pop(0):
            raise RenderError("the disk is full")
        update_manifest(folder, records, lock_timeout_s)

    monkeypatch.setattr(batch, "_make_in_process", made)
    monkeypatch.setattr(batch, "update_manifest", write)
    run_batch(orders(tmp_path, "a", "b", "c"), {}, tmp_path, Reporter(is_quiet=True))
    assert {Path(film["scene"]).stem: film["status"] for film in films(tmp_path)} == {
        "a": "failed",
        "b": "done",
        "c": "done",
    }


FRAME = {"frame": 0, "tolerance": 0.1, "cells": 3, "splats": 1, "seconds": {}}
FRAMES = [FRAME, FRAME | {"frame": 1, "splats": 4}]
COSTS: dict[str, tuple[dict[str, Any], dict[str, float]]] = {
    "as written": (
        {"frames": FRAMES, "seconds": {"read": 1.0, "total": 2.71828}},
        {"frames": 2, "splats": 2, "seconds": 2.718},
    ),
    "no seconds": ({"frames": FRAMES}, {"frames": 2, "splats": 2}),
    "no total": ({"frames": FRAMES, "seconds": {}}, {"frames": 2, "splats": 2}),
    "a list of seconds": ({"frames": FRAMES, "seconds": [1]}, {"frames": 2, "splats": 2}),
    "text for seconds": ({"frames": FRAMES, "seconds": {"total": "x"}}, {"frames": 2, "splats": 2}),
    "not a number": ({"frames": FRAMES, "seconds": {"total": math.nan}}, {"frames": 2, "splats": 2}),
    "infinity": ({"frames": FRAMES, "seconds": {"total": math.inf}}, {"frames": 2, "splats": 2}),
    "negative": ({"frames": FRAMES, "seconds": {"total": -1}}, {"frames": 2, "splats": 2}),
    "very many splats": ({"frames": [FRAME | {"splats": 10**400}]}, {"frames": 1}),
}


@pytest.mark.parametrize("case", COSTS)
def test_statistics_of_a_film_that_was_up_to_date(case: str) -> None:
    """Anybody may have edited its sidecar."""
    record, expected = COSTS[case]
    assert one_film.film_statistics(Film(Path("scan.mp4"), Path("scan.mp4.json"), record)) == expected


def scene(text: str) -> SuggestedScene:
    return SuggestedScene(text, "scan", "for a test")


def test_a_scene_is_known_whenever_its_writer_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "out" / "scan.yaml"
    write_scene(order(tmp_path), scene("one"))

    def full(path: Path, content: bytes) -> None:
        raise RenderError("the disk is full")

    with monkeypatch.context() as patch:  # between the report and the scene
        patch.setattr(one_film, "write_staged", full)
        with pytest.raises(RenderError):
            write_scene(order(tmp_path), scene("two"))
    assert file.read_text() == "one"
    write_scene(order(tmp_path), scene("three"))
    assert file.read_text() == "three"


def test_a_forced_writer_that_is_killed_leaves_its_own_scene_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(path: Path, content: bytes) -> None:
        raise RenderError("the disk is full")

    write_scene(order(tmp_path), scene("one"))
    with monkeypatch.context() as patch:
        patch.setattr(one_film, "write_staged", full)
        with pytest.raises(RenderError):
            write_scene(order(tmp_path, force=True), scene("two"))
    write_scene(order(tmp_path), scene("three"))
    assert (tmp_path / "out" / "scan.yaml").read_text() == "three"


def test_an_edited_scene_is_never_known(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not even when a forced writer has told that it will write over it, and was killed."""
    file = tmp_path / "out" / "scan.yaml"
    write_scene(order(tmp_path), scene("one"))
    file.write_text("mine")

    def full(path: Path, content: bytes) -> None:
        raise RenderError("the disk is full")

    with monkeypatch.context() as patch:
        patch.setattr(one_film, "write_staged", full)
        with pytest.raises(RenderError):
            write_scene(order(tmp_path, force=True), scene("two"))
    with pytest.raises(InputError, match="perhaps one that was edited"):
        write_scene(order(tmp_path), scene("two"))
    assert file.read_text() == "mine"
    write_scene(order(tmp_path, force=True), scene("two"))
    write_scene(order(tmp_path), scene("three"))
    assert file.read_text() == "three"


def test_a_scene_that_would_be_written_the_same_is_known_again(tmp_path: Path) -> None:
    write_scene(order(tmp_path), scene("one"))
    (tmp_path / "out" / MANIFEST_FILE).unlink()
    write_scene(order(tmp_path), scene("one"))
    write_scene(order(tmp_path), scene("two"))
    assert (tmp_path / "out" / "scan.yaml").read_text() == "two"


def test_a_film_is_done_until_its_scene_is_another(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    write_scene(order(tmp_path), scene("one"))
    assert films(folder)[0]["status"] == "begun"
    update_manifest(folder, [order(tmp_path).record("done") | {"frames": 3}])
    done = films(folder)
    write_scene(order(tmp_path), scene("one"))
    assert films(folder) == done
    write_scene(order(tmp_path), scene("two"))
    assert films(folder)[0]["status"] == "begun"


def test_another_volume_of_the_same_name(tmp_path: Path) -> None:
    write_scene(order(tmp_path), scene("one"))
    with pytest.raises(InputError, match="another volume"):
        write_scene(order(tmp_path, "scan.nrrd"), scene("two"))
    write_scene(order(tmp_path, "scan.nrrd", force=True), scene("two"))
    assert (tmp_path / "out" / "scan.yaml").read_text() == "two"
