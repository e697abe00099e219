"""turntable.json lists the films of a folder, whichever commands made them, one after the other or at once."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from commands import environment, other_process

from hsplat_cli.scenes import SCHEMA_LINE
from hsplat_cli.terminal import Reporter
from hsplat_cli.turntable import (
    FILM_ENTRY,
    MANIFEST,
    MANIFEST_FILE,
    FilmRequest,
    marked_scene,
    update_manifest,
    write_scene,
)
from renderer.errors import InputError, RenderError
from renderer.record import field_types, record_to_json
from renderer.scene import FileSource, VolumeSpec
from renderer.suggest import FilmOptions


def update(folder: Path, records: list[dict[str, Any]], *lock_timeout_s: float) -> None:
    entries = [field_types.read_record(FILM_ENTRY, each) for each in records]
    update_manifest(folder, [each for each in entries if each is not None], Reporter(), *lock_timeout_s)


def record(name: str, status: str = "done", **more: Any) -> dict[str, Any]:
    paths = {"volume": f"../../{name}.npy", "scene": f"{name}.yaml", "film": f"{name}.mp4"}
    return {**paths, "status": status, **more}


def films(folder: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads((folder / MANIFEST_FILE).read_bytes())["films"]
    return found


def test_records_of_other_films_stay_while_their_scenes_do(tmp_path: Path) -> None:
    (tmp_path / "a.yaml").touch()
    first = [record("a"), record("b"), record("c", "failed")]
    update(tmp_path, first)
    assert films(tmp_path) == first  # all of the command's own
    update(tmp_path, [record("d")])
    assert films(tmp_path) == [first[0], record("d")]
    update(tmp_path, [record("a", "failed", error="it did")])
    assert films(tmp_path) == [record("a", "failed", error="it did")]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.yaml", MANIFEST_FILE]


def test_records_of_failures_stay_while_their_volumes_do(tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "out"
    folder.mkdir(parents=True)
    (tmp_path / "link").symlink_to(folder)  # paths are relative to the folder without links
    (tmp_path / "a.npy").touch()
    failed = [record(name, "failed", error="it did") for name in "ab"]
    update(tmp_path / "link", failed)
    update(tmp_path / "link", [record("c")])
    assert films(folder) == [failed[0], record("c")]
    (tmp_path / "a.npy").unlink()
    update(folder, [record("d")])
    assert films(folder) == [record("d")]


def test_films_that_were_not_started_change_nothing(tmp_path: Path) -> None:
    """Neither do films that were interrupted before they started."""
    for name in "abc":
        (tmp_path / f"{name}.yaml").touch()
    update(tmp_path, [record("a", frames=3), record("b", "failed"), record("c", "begun")])
    update(tmp_path, [record(name, "not begun") for name in "abcd"])
    assert films(tmp_path) == [record("a", frames=3), record("b", "failed"), record("c", "begun")]
    update(tmp_path, [record(name, "interrupted") for name in "abcd"])
    assert films(tmp_path) == [record("a", frames=3), record("b", "failed"), record("c", "interrupted")]
    update(tmp_path / "new", [record("a", "interrupted"), record("b", "not begun")])
    assert list((tmp_path / "new").iterdir()) == []


WRITER = """
import sys
from pathlib import Path
from hsplat_cli.terminal import Reporter
from hsplat_cli.turntable import FilmEntry, update_manifest
for number in range(10):
    name = f"{sys.argv[2]}-{number}"
    (Path(sys.argv[1]) / f"{name}.yaml").touch()
    update_manifest(Path(sys.argv[1]), [FilmEntry(name, f"{name}.yaml", name, "done")], Reporter())
"""


def test_several_processes_lose_no_record(tmp_path: Path) -> None:
    arguments = [sys.executable, "-c", WRITER, str(tmp_path)]
    processes = [subprocess.Popen([*arguments, str(number)], env=environment()) for number in range(3)]
    assert [process.wait() for process in processes] == [0] * 3
    expected = {f"{process}-{number}" for process in range(3) for number in range(10)}
    assert {film["volume"] for film in films(tmp_path)} == expected
    assert [path.name for path in tmp_path.iterdir() if path.suffix != ".yaml"] == [MANIFEST_FILE]


def test_a_wait_is_reported_and_ends(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr("hsplat_cli.turntable.manifest._NOTICE_DELAY_S", 0.1)
    imports = "from hsplat_cli.terminal import Reporter\nfrom hsplat_cli.turntable import locked_manifest"
    with (
        other_process(imports, f"locked_manifest(Path({str(tmp_path)!r}), Reporter(), 1)") as number,
        pytest.raises(RenderError) as caught,
    ):
        update(tmp_path, [record("a")], 0.2)
    holder, file = f"process {number} on {os.uname().nodename}", tmp_path / MANIFEST_FILE
    assert str(caught.value) == (
        f"{file}: another process is changing this file\n  got: {holder}\n"
        "  hint: end that process, or let it finish; the same command makes only what is missing"
    )
    assert capsys.readouterr().err == f"{file}: waiting for {holder}\n"
    update(tmp_path, [record("a")], 0.0)
    assert films(tmp_path) == [record("a")]


# Files that this program has not written.
FORGED = {
    "nothing": b"",
    "cut off": json.dumps({"films": [record("a")]}).encode()[:-3],
    "no object": b"[1]",
    "no films": b"{}",
    "an object of films": b'{"films": {"a": 1}}',
    "deep": b'{"films":' + 100_000 * b"[",
    "long digits": b'{"films": [' + 5000 * b"9" + b"]}",
}


@pytest.mark.parametrize("case", FORGED)
def test_a_damaged_file_is_ignored(case: str, tmp_path: Path) -> None:
    (tmp_path / "a.yaml").touch()
    (tmp_path / MANIFEST_FILE).write_bytes(FORGED[case])
    update(tmp_path, [record("b")])
    assert films(tmp_path) == [record("b")]


def test_damaged_records_are_dropped_and_others_stay(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in "acde":
        (tmp_path / f"{name}.yaml").touch()
    good = record("a", rating=[4, {"of": 5}], checked=None)
    deep = json.loads(500 * "[" + 500 * "]")
    broken: list[Any] = [
        1,
        None,
        [[]],
        {"scene": "c.yaml"},
        record("a") | {"scene": 1},
        record("c", seconds=float("nan")),
        record("d", volume=1),
        record("e", scene="out/e.yaml"),  # as another version wrote it
        record("e", more=deep),
    ]
    odd = [record("a") | {"scene": scene} for scene in ("\ud800.yaml", "a\0.yaml", "..", "", "/", "a" * 300)]
    content = {"made": ["by hand"], "films": [good, *broken, *odd]}
    (tmp_path / MANIFEST_FILE).write_text(json.dumps(content), encoding="utf-8")
    update(tmp_path, [record("z")])
    assert json.loads((tmp_path / MANIFEST_FILE).read_bytes())["made"] == ["by hand"]
    found = films(tmp_path)
    assert [each for each in found if each not in odd] == [good, record("z")]
    left_out = "10 records left out: damaged, or of another version of hsplat"
    assert capsys.readouterr().err == f"{tmp_path / MANIFEST_FILE}: {left_out}\n"


def test_other_things_of_this_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A file that is too large is replaced; a pipe and a folder are errors."""
    os.mkfifo(tmp_path / MANIFEST_FILE)
    with pytest.raises(InputError, match="the output is a device or a pipe"):
        update(tmp_path, [record("b")])
    (tmp_path / MANIFEST_FILE).unlink()
    update(tmp_path, [record("b")])
    (tmp_path / "b.yaml").touch()
    monkeypatch.setattr("hsplat_cli.turntable.manifest.MANIFEST", replace(MANIFEST, max_bytes=50))
    update(tmp_path, [record("a")])
    assert films(tmp_path) == [record("a")]
    (tmp_path / "folder" / MANIFEST_FILE).mkdir(parents=True)
    with pytest.raises(InputError, match="the output is a folder"):
        update(tmp_path / "folder", [record("b")])


def order(folder: Path, volume: str = "scan.npy", *, force: bool = False) -> FilmRequest:
    (folder / volume).touch()
    spec = VolumeSpec(FileSource(folder / volume))
    out = folder / "out"
    return FilmRequest(spec, FilmOptions(), out / "scan.yaml", out / "scan.mp4", None, force)


def write(request: FilmRequest, text: str) -> None:
    write_scene(request, marked_scene(text, request.volume_path), Reporter())


def test_an_edited_scene_is_kept_unless_forced(tmp_path: Path) -> None:
    file = tmp_path / "out" / "scan.yaml"
    write(order(tmp_path), "one")
    write(order(tmp_path), "two")
    unedited = file.read_text()
    assert unedited.startswith(SCHEMA_LINE + "two\n# `hsplat turntable` replaces this file")
    for text in ("mine", unedited.replace("two", "2"), unedited + "\n", unedited.replace("scan.npy", "scan.mha")):
        file.write_text(text)
        with pytest.raises(InputError, match="perhaps one that was edited"):
            write(order(tmp_path), "three")
        assert file.read_text() == text
    write(order(tmp_path, force=True), "three")
    assert file.read_text().startswith(SCHEMA_LINE + "three")


def test_a_film_is_done_until_its_scene_changes(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    write(order(tmp_path), "one")
    assert films(folder)[0]["status"] == "begun"
    update(folder, [record_to_json(order(tmp_path).entry("done")) | {"frames": 3}])
    done = films(folder)
    write(order(tmp_path), "one")
    assert films(folder) == done
    write(order(tmp_path), "two")
    assert films(folder)[0]["status"] == "begun"


@pytest.mark.parametrize("volume", ["scan.npy", 'a "b"; of: \n.npy', os.fsdecode(b"\xff.npy")])
def test_the_scene_of_another_volume_is_kept(volume: str, tmp_path: Path) -> None:
    write(order(tmp_path, volume), "one")
    write(order(tmp_path, volume), "two")
    with pytest.raises(InputError, match="another volume"):
        write(order(tmp_path, "scan.nrrd"), "three")
    write(order(tmp_path, "scan.nrrd", force=True), "three")
    assert (tmp_path / "out" / "scan.yaml").read_text().startswith(SCHEMA_LINE + "three")
