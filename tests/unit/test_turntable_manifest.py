"""turntable.json lists the films of a folder, whichever commands made them, one after the other or at once."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any
from unittest import mock

import pytest

from hsplat_cli.executors import ExecutorSpec
from hsplat_cli.films import FilmResult
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
    assert films(tmp_path) == first  # all of the command's own
    update_manifest(tmp_path, [record("d")])
    assert films(tmp_path) == [first[0], first[2], record("d")]
    update_manifest(tmp_path, [record("a", "failed", error="it did")])
    assert films(tmp_path) == [first[2], record("d"), {**WRITTEN, **record("a", "failed", error="it did")}]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.yaml", MANIFEST_FILE]


def test_records_without_scenes_stay_while_their_volumes_do(tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "out"
    folder.mkdir(parents=True)
    (tmp_path / "link").symlink_to(folder)  # paths are relative to the folder without links
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


def test_films_that_were_not_started_change_nothing(tmp_path: Path) -> None:
    """Neither do films that were interrupted before they started."""
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


def test_several_processes_lose_no_record(tmp_path: Path) -> None:
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


def test_a_wait_is_reported_and_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(manifest_module, "_NOTICE_DELAY_S", 0.1)
    arguments = [sys.executable, "-c", HOLDER, str(tmp_path)]
    environment = os.environ | {"PYTHONPATH": str(CODE)}
    with subprocess.Popen(arguments, env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"\n"
        with pytest.raises(RenderError) as caught:
            update_manifest(tmp_path, [record("a")], 0.2)
        process.communicate(b"")
    holder, file = f"process {process.pid} on {os.uname().nodename}", tmp_path / MANIFEST_FILE
    assert str(caught.value) == (
        f"{file}: another process is changing this file\n  got: {holder}\n"
        "  hint: end that process, or let it finish; the same command makes only what is missing"
    )
    assert capsys.readouterr().err == f"{file}: waiting for {holder}\n"
    update_manifest(tmp_path, [record("a")], 0.0)
    assert films(tmp_path) == [record("a")]


GOOD = record("a", **WRITTEN)

# Files that this program has not written.
FORGED = {
    "nothing": b"",
    "no JSON": b"\xff\xfe{",
    "cut off": json.dumps({"films": [GOOD]}).encode()[:-3],
    "no object": b"[1]",
    "no films": b"{}",
    "an object of films": b'{"films": {"a": 1}}',
    "deep": b'{"films":' + 100_000 * b"[",
    "deep in a record": json.dumps({"films": [GOOD]}).replace('"done"', 500 * "[" + 500 * "]").encode(),
    "long digits": b'{"films": [' + 5000 * b"9" + b"]}",
    "infinity": json.dumps({"films": [GOOD]}).replace('"done"', '"done", "seconds": 1e999').encode(),
}


@pytest.mark.parametrize("case", FORGED)
def test_a_damaged_file_is_ignored(case: str, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").touch()
    (tmp_path / MANIFEST_FILE).write_bytes(FORGED[case])
    with open_manifest(tmp_path) as manifest:
        assert manifest.record_of(Path("a.yaml")) == {}
    update_manifest(tmp_path, [record("b")])
    assert films(tmp_path) == [record("b")]


def test_damaged_records_are_dropped_and_all_else_stays(tmp_path: Path) -> None:
    for name in "acdefgh":
        (tmp_path / f"{name}.yaml").touch()
    good = [GOOD | {"rating": [4, {"of": 5}], "checked": None}, record("b")]
    broken: list[Any] = [
        1,
        None,
        [[]],
        {"scene": "c.yaml"},
        GOOD | {"scene": 1},
        record("d", seconds=float("nan")),
        record("e", **WRITTEN | {"scene_digests": "0"}),
        record("f", **WRITTEN | {"scene_digests": [0]}),
        record("g", **WRITTEN | {"scene_of": 1}),
        record("h", scene_digests=["0" * 32]),
    ]
    content = {"title": "scans", "films": [good[0], *broken, good[1]], "deep": json.loads(50 * "[" + 50 * "]")}
    (tmp_path / MANIFEST_FILE).write_text(json.dumps(content | {"odd": float("inf")}), encoding="utf-8")
    update_manifest(tmp_path, [record("z")])
    assert json.loads((tmp_path / MANIFEST_FILE).read_bytes()) == {"films": [*good, record("z")], "title": "scans"}


def test_records_with_odd_names_do_no_harm(tmp_path: Path) -> None:
    forged = [GOOD | {"scene": scene} for scene in ("\ud800.yaml", "a\0.yaml", "..", "", "/", "a" * 300)]
    (tmp_path / MANIFEST_FILE).write_text(json.dumps({"films": forged}), encoding="utf-8")
    update_manifest(tmp_path, [record("b")])
    assert films(tmp_path)[-1] == record("b")


def test_a_file_that_is_too_large_is_ignored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    update_manifest(tmp_path, [record("a")])
    monkeypatch.setattr(manifest_module, "_MAX_BYTES", 50)
    update_manifest(tmp_path, [record("b")])
    assert films(tmp_path) == [record("b")]


def test_a_pipe_of_this_name_is_replaced_and_a_folder_is_an_error(tmp_path: Path) -> None:
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


def test_an_interrupted_batch_keeps_the_records(
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


def test_a_batch_writes_each_record_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A record that could not be written is written with the next film; later it may be one of another command."""
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
    "no total": ({"frames": FRAMES, "seconds": {}}, {"frames": 2, "splats": 2}),
    "a list of seconds": ({"frames": FRAMES, "seconds": [1]}, {"frames": 2, "splats": 2}),
    "not a number": ({"frames": FRAMES, "seconds": {"total": math.nan}}, {"frames": 2, "splats": 2}),
    "very many splats": ({"frames": [FRAME | {"splats": 10**400}], "seconds": {"total": -1}}, {"frames": 1}),
}


@pytest.mark.parametrize("case", COSTS)
def test_statistics_leave_out_numbers_that_cannot_be(case: str) -> None:
    """The sidecar of a film that was up to date may have been edited."""
    record, expected = COSTS[case]
    assert one_film.film_statistics(FilmResult(Path("scan.mp4"), Path("scan.mp4.json"), record)) == expected


def scene(text: str) -> SuggestedScene:
    return SuggestedScene(text, "scan", "for a test")


def kill_writer(request: FilmRequest, text: str) -> None:
    """Write a scene as a process does that is killed between the record and the scene."""
    with mock.patch.object(one_film, "write_staged", side_effect=RenderError("killed")), pytest.raises(RenderError):
        write_scene(request, scene(text))


@pytest.mark.parametrize("force", [False, True])
def test_a_scene_stays_known_when_its_writer_is_killed(tmp_path: Path, force: bool) -> None:
    write_scene(order(tmp_path), scene("one"))
    kill_writer(order(tmp_path, force=force), "two")
    assert (tmp_path / "out" / "scan.yaml").read_text() == "one"
    write_scene(order(tmp_path), scene("three"))
    assert (tmp_path / "out" / "scan.yaml").read_text() == "three"


def test_an_edited_scene_is_never_known(tmp_path: Path) -> None:
    """A forced writer that was killed before it overwrote the scene does not make it known either."""
    file = tmp_path / "out" / "scan.yaml"
    write_scene(order(tmp_path), scene("one"))
    file.write_text("mine")
    kill_writer(order(tmp_path, force=True), "two")
    with pytest.raises(InputError, match="perhaps one that was edited"):
        write_scene(order(tmp_path), scene("two"))
    assert file.read_text() == "mine"
    write_scene(order(tmp_path, force=True), scene("two"))
    assert file.read_text() == "two"


def test_a_film_is_done_until_its_scene_changes(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    write_scene(order(tmp_path), scene("one"))
    assert films(folder)[0]["status"] == "begun"
    update_manifest(folder, [order(tmp_path).record("done") | {"frames": 3}])
    done = films(folder)
    write_scene(order(tmp_path), scene("one"))
    assert films(folder) == done
    write_scene(order(tmp_path), scene("two"))
    assert films(folder)[0]["status"] == "begun"


def test_the_scene_of_another_volume_is_kept(tmp_path: Path) -> None:
    write_scene(order(tmp_path), scene("one"))
    with pytest.raises(InputError, match="another volume"):
        write_scene(order(tmp_path, "scan.nrrd"), scene("two"))
    write_scene(order(tmp_path, "scan.nrrd", force=True), scene("two"))
    assert (tmp_path / "out" / "scan.yaml").read_text() == "two"
