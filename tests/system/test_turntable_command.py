"""`hsplat init` and `hsplat turntable`, from volumes to the files that they write."""

from __future__ import annotations

import json
import math
import os
import re
import signal
import subprocess
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import numpy as np
import pytest
import yaml
from commands import HSPLAT, environment, files, other_process
from dicom_files import image_fields, save
from kinds_of_data import KINDS
from processes import MARK, marked, new_mark, wait_until

from hsplat_cli import main
from hsplat_cli.turntable import FilmEntry, FilmRequest, write_scene
from renderer.system import ChildProcesses

pytestmark = pytest.mark.usefixtures("heeds_interrupts")

# The program of a process that makes films; a volume of the name `signed` kills it.
DEADLY = """
import os, pkgutil, signal
from pytest import MonkeyPatch
from hsplat_cli.main import main

READER = "renderer.readers.numpy_arrays:read_npy"
read_npy = pkgutil.resolve_name(READER)

def read_or_die(path, *arguments):
    if path.stem == "signed":
        os.kill(os.getpid(), signal.SIGKILL)
    return read_npy(path, *arguments)

MonkeyPatch().setattr(READER.replace(":", "."), read_or_die)
main()
"""
SMALL = ["--frames", "3", "--size", "32", "--quiet"]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the current folder, with three volumes in `in`."""
    monkeypatch.chdir(tmp_path)
    Path("in").mkdir()
    for name in ("uint8", "signed", "labels"):
        np.save(f"in/{name}.npy", KINDS[name][0][8:40, 8:40, 8:40])
    return tmp_path


def turntable(*arguments: str) -> int:
    return main.run(["turntable", *arguments])


def report(folder: str = "out") -> list[dict[str, Any]]:
    films: list[dict[str, Any]] = json.loads(Path(folder, "turntable.json").read_text(encoding="utf-8"))["films"]
    return films


def test_init_and_info_suggest_the_same(capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("uint8", "signed", "labels"):
        assert main.run(["init", f"in/{name}.npy", "--output", f"{name}.yaml"]) == 0
        capsys.readouterr()
        assert main.run(["info", f"in/{name}.npy", "--json"]) == 0
        told = json.loads(capsys.readouterr().out)
        written = yaml.safe_load(Path(f"{name}.yaml").read_text(encoding="utf-8"))
        section = "labels" if name == "labels" else "transfer_function"
        assert json.loads(json.dumps(written[section])) == told[section]


@pytest.mark.slow
def test_a_film_that_another_command_makes_is_left_alone(capfd: pytest.CaptureFixture[str]) -> None:
    """Its scene and its record stay, too."""
    assert turntable("in/uint8.npy", "-o", "out", *SMALL) == 0
    before, told = Path("out/uint8.yaml").read_bytes(), report()
    capfd.readouterr()
    lock = "lock_slots(Path('out/uint8.mp4.unfinished'), [0], Path())"
    with other_process("from renderer.film import lock_slots", lock):
        assert turntable("in/uint8.npy", "-o", "out", "--frames", "5", "--size", "32", "--force", "--quiet") == 2
        assert capfd.readouterr().err.startswith("out/uint8.mp4: another job is writing this output\n  got: process ")
        assert (Path("out/uint8.yaml").read_bytes(), report()) == (before, told)
        assert turntable("in/uint8.npy", "in/signed.npy", "-o", "out", *SMALL) == 2
    table = capfd.readouterr().out.splitlines()
    assert table[1].split()[1:3] == ["not", "begun"]
    assert table[1].endswith("out/uint8.mp4: another job is writing this output")
    assert report()[1] == told[0]
    assert (report()[0]["scene"], report()[0]["status"]) == ("signed.yaml", "done")


def test_a_film_is_done_until_another_is_begun(monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*arguments: object, **options: object) -> None:
        raise KeyboardInterrupt

    assert turntable("in/uint8.npy", "-o", "out", *SMALL) == 0
    before = report()
    with monkeypatch.context() as patch:
        patch.setattr("renderer.job.film_making.film_fingerprint", interrupt)
        assert turntable("in/uint8.npy", "-o", "out", *SMALL) == 130
        assert report() == before
    monkeypatch.setattr("renderer.job.film_making._resume_checkpoint", interrupt)
    assert turntable("in/uint8.npy", "-o", "out", *SMALL) == 0
    assert report() == before
    Path("out/uint8.mp4").unlink()
    assert turntable("in/uint8.npy", "-o", "out", *SMALL) == 130
    assert report()[0]["status"] == "interrupted"


def test_the_film_is_that_of_the_scene_that_was_written(monkeypatch: pytest.MonkeyPatch) -> None:
    """An edit of the file before it is read has no effect."""

    def edit(*arguments: Any) -> None:
        write_scene(*arguments)
        scene = Path("out/uint8.yaml")
        text = scene.read_text(encoding="utf-8")
        assert "frames: 3" in text
        scene.write_text(text.replace("frames: 3", "frames: 7"), encoding="utf-8")

    monkeypatch.setattr("hsplat_cli.turntable.one_film.write_scene", edit)
    assert turntable("in/uint8.npy", "-o", "out", *SMALL) == 0
    assert imageio.imread("out/uint8.mp4", plugin="FFMPEG").shape[0] == 3


@pytest.mark.slow
def test_a_wait_for_turntable_json_is_reported_and_can_be_interrupted() -> None:
    volumes = ["in/uint8.npy", "in/labels.npy"]
    arguments = [*HSPLAT, "turntable", *volumes, "-o", "out", *SMALL]
    imports = "from renderer.film import lock_slots"
    lock = "lock_slots(Path('out'), [0], Path(), shared_file='.turntable.json.lock')"
    with other_process(imports, lock) as number:
        process = subprocess.Popen(arguments, env=environment(), stderr=subprocess.PIPE, text=True)
        assert process.stderr is not None
        waiting = f"out/turntable.json: waiting for process {number} on {os.uname().nodename}\n"
        assert process.stderr.readline() == waiting
        process.send_signal(signal.SIGTERM)
        _, said = process.communicate(timeout=30)
        assert process.returncode == 143
        assert set(said.splitlines()) == {"hsplat: interrupted"}  # the film's process prints it, too
    assert files("out") == []


@pytest.mark.slow
def test_a_film_that_is_up_to_date_needs_no_process(monkeypatch, capfd) -> None:
    """Sizes and times of files tell that it is; where they do not, its process looks whether it is."""
    volumes, started = ["in/uint8.npy", "in/signed.npy"], list[str]()
    command = [*volumes, "-o", "out", *SMALL, "--format=png"]
    os.utime("in/uint8.npy", ns=(10**18, 10**18))
    assert turntable(*command) == 0
    table = capfd.readouterr().out

    def start(_: object, request: FilmRequest, *__: object) -> FilmEntry:
        started.append(str(request.volume.source.file))
        return replace(request.entry("failed"), error="not drawn")

    def needs(*more: str) -> list[str]:
        started.clear()
        with monkeypatch.context() as patch:
            patch.setattr("hsplat_cli.turntable.film_process.FilmProcesses.make", start)
            assert turntable(*command, *more) == bool(started)
        return [*started]

    assert needs() == []
    assert capfd.readouterr().out.startswith(table)
    assert needs("--tolerance=0.2") == needs("--force") == volumes
    with monkeypatch.context() as patch:
        patch.setattr("hsplat_cli.turntable.film_request._program", lambda: {"versions": "others"})
        assert needs() == volumes
    content = Path("in/uint8.npy").read_bytes()
    Path("in/uint8.npy").write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    os.utime("in/uint8.npy", ns=(10**18, 10**18))
    assert needs() == volumes[:1]
    assert turntable(*command) == 0
    Path("in/uint8.npy").touch()
    assert needs() == volumes[:1]
    before = files("out"), Path("out/uint8/0001.png").stat().st_mtime_ns
    assert turntable(*command) == 0
    assert (files("out"), Path("out/uint8/0001.png").stat().st_mtime_ns) == before
    assert needs() == []
    Path("out/signed/0002.png").touch()
    Path("out/uint8.yaml").unlink()
    assert needs() == volumes


@pytest.mark.slow
def test_odd_names() -> None:
    names = ["-dash and two\nlines.npy", os.fsdecode(b"a b'c\"d: {frame}\xff.npy")]
    for name in names:
        Path(name).write_bytes(Path("in/uint8.npy").read_bytes())
    assert turntable("-o", "out", *SMALL, "--", *names) == 0
    assert [record["status"] for record in report()] == ["done"] * 2
    assert len([name for name in files("out") if name.endswith(".mp4")]) == 2


@pytest.fixture
def processes(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return a list that gets the number of threads of each process that is started. There is enough memory for all."""
    start, threads = ChildProcesses.start, list[str]()

    def started(
        child_processes: ChildProcesses, module: str, arguments: list[str], **options: Any
    ) -> subprocess.Popen[bytes]:
        assert module == "hsplat_cli"
        process = start(child_processes, "deadly" if Path("deadly.py").exists() else module, arguments, **options)
        threads.append(options["env"]["LP_NUM_THREADS"])
        return process

    monkeypatch.setattr(ChildProcesses, "start", started)
    monkeypatch.setattr("hsplat_cli.turntable.batch.free_bytes", lambda: math.inf)
    return threads


@pytest.mark.slow
def test_a_film_that_ends_its_process_fails_alone(folder, processes, monkeypatch, capfd) -> None:
    """The other films are made by the two processes before it, and by one after it."""
    Path("deadly.py").write_text(DEADLY, encoding="utf-8")
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setenv("LP_NUM_THREADS", "2")
    for name in ("a", "b"):
        np.save(f"in/{name}.npy", KINDS["uint8"][0][8:40, 8:40, 8:40])
    volumes = [f"in/{name}.npy" for name in ("a", "labels", "signed", "uint8", "b")]
    assert turntable(*volumes, "-o", "out", *SMALL) == 1
    films = report()
    assert [film["status"] for film in films] == ["done", "done", "done", "failed", "done"]
    assert (films[3]["exit_code"], films[3]["volume"]) == (-signal.SIGKILL, "../in/signed.npy")
    assert processes == ["1"] * 3
    assert not [name for name in files("out") if "signed" in name]
    message = (
        "in/signed.npy: the process that made this film ended early\n"
        "  got: signal SIGKILL\n  hint: where memory runs out the system sends this signal\n"
    )
    assert message in capfd.readouterr().err
    assert {Path("out", f"{name}.mp4").exists() for name in ("a", "labels", "uint8", "b")} == {True}


@pytest.mark.slow
def test_several_processes_make_the_same_films_and_print_the_same(processes, monkeypatch, capfd) -> None:
    """The second volume, of which nothing can be made, fails long before the first film is made."""
    np.save("in/broken.npy", np.zeros(3))
    for name in ("a", "b", "c"):
        np.save(f"in/{name}.npy", KINDS["uint8"][0][8:40, 8:40, 8:40] // (ord(name) - 96))
    volumes = [f"in/{name}.npy" for name in ("uint8", "broken", "c", "labels", "a", "b")]
    printed, made = [], []
    for num in (1, 2):
        monkeypatch.setenv("LP_NUM_THREADS", str(num))
        processes.clear()
        assert turntable(*volumes, "-o", f"out{num}", "--frames=3", "--size=32") == 2
        assert processes == ["1"] * num
        lines = capfd.readouterr().err.replace(f"out{num}", "out").splitlines()
        printed.append([line for line in lines if not re.search(r": \d+/\d+ ", line)])  # progress depends on time
        made.append([Path(f"out{num}", name).read_bytes() for name in files(f"out{num}") if name.endswith(".mp4")])
        order = [record["scene"] for record in report(f"out{num}")]
        assert order == sorted(order)
    assert printed[0] == printed[1]
    assert [line[:5] for line in printed[0] if line[:1] == "["] == [f"[{number}/6]" for number in range(1, 7)]
    assert made[0] == made[1]
    assert len(made[0]) == 5


@pytest.mark.slow
@pytest.mark.parametrize(
    ("volume", "patched", "value"),
    [("a.npy", "free_bytes", lambda: 1.9e9), ("a", "_SMALL_BYTES", 1 << 24)],
)
def test_one_process_makes_films_of_large_volumes(processes, volume, patched, value, monkeypatch) -> None:
    """Also films for which there is little memory, and films of a folder, which may be large."""
    monkeypatch.setenv("LP_NUM_THREADS", "2")
    monkeypatch.setattr(f"hsplat_cli.turntable.batch.{patched}", value)
    values = KINDS["uint8"][0][8:40, 8:40, 8:40]
    np.save("in/a.npy", values)
    Path("in/a").mkdir()
    for number, slice_ in enumerate(values):
        imageio.imwrite(f"in/a/{number:02}.png", slice_)
    volumes = [f"in/{name}" for name in ("uint8.npy", "signed.npy", "labels.npy", volume)]
    assert turntable(*volumes, "-o", "out", *SMALL) == 0
    assert processes == ["2"]


@pytest.mark.slow
def test_an_interrupt_ends_all_films_that_are_made() -> None:
    """Two processes make films of four volumes, and remove what is unfinished."""
    Path("in/c.npy").write_bytes(Path("in/signed.npy").read_bytes())
    mark = new_mark()
    arguments = ["turntable", *(f"in/{name}.npy" for name in ("uint8", "signed", "labels", "c")), "-o", "out"]
    process = subprocess.Popen(
        [*HSPLAT, *arguments, "--frames=2000", "--size=16"],
        env=environment(LP_NUM_THREADS="2", **{MARK: mark}),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    while not all(list(Path("out").glob(f"{name}.mp4.unfinished/*.json")) for name in ("uint8", "signed")):
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(signal.SIGTERM)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 143
    assert err.count("hsplat: interrupted\n") == 3  # both processes print it, too
    assert not marked(mark)
    assert [record["status"] for record in report()] == ["interrupted"] * 2
    assert [line.split()[1] for line in out.splitlines()[-4:]] == ["interrupted", "interrupted", "not", "not"]


@pytest.mark.slow
def test_an_interrupt_ends_the_batch_and_lists_what_is_done() -> None:
    """Only the parent gets the signal, while the second film is made: the process of the film ends, too.

    The page of films may already have been written, or not.
    """
    arguments = ["turntable", "in/uint8.npy", "in/signed.npy", "in/labels.npy", "-o", "out", "--frames", "150"]
    process = subprocess.Popen(
        [*HSPLAT, *arguments, "--size", "16"],
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    while not list(Path("out").glob("signed.mp4.unfinished/*.json")):
        assert process.poll() is None
        time.sleep(0.02)
    process.send_signal(signal.SIGTERM)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 143
    assert err.endswith("hsplat: interrupted\n")
    assert {record["scene"]: record["status"] for record in report()} == {
        "uint8.yaml": "done",
        "signed.yaml": "interrupted",
    }
    assert [line.split()[1] for line in out.splitlines()[-3:]] == ["done", "interrupted", "not"]
    names = {"signed.yaml", "turntable.json", "uint8.mp4", "uint8.mp4.json", "uint8.yaml"}
    found = {name for name in files("out") if "unfinished" not in name}
    assert found - {"index.html", "posters/uint8.jpg"} == names


@pytest.mark.slow
def test_a_batch_that_is_killed_leaves_nothing_that_runs() -> None:
    """The processes of two films and their encoders end."""
    mark = new_mark()
    Path("in/c.npy").write_bytes(Path("in/signed.npy").read_bytes())
    volumes = [f"in/{name}.npy" for name in ("labels", "signed", "uint8", "c")]
    arguments = ["turntable", *volumes, "-o", "out", "--frames", "400", "--size", "64", "--quiet"]
    process = subprocess.Popen(
        [*HSPLAT, *arguments], env=environment(LP_NUM_THREADS="2", **{MARK: mark}), start_new_session=True
    )
    while not all(list(Path("out").glob(f"{name}.mp4.unfinished/000003.json")) for name in ("labels", "signed")):
        assert process.poll() is None
        time.sleep(0.02)
    assert len(marked(mark)) >= 5  # the batch, the films and their encoders
    process.kill()
    process.wait()
    assert wait_until(lambda: not marked(mark), 5.0)
    assert not Path("out/labels.mp4").exists()
    assert [record["status"] for record in report()] == ["begun"] * 2


@pytest.mark.slow
def test_a_bad_input_fails_alone(capsys: pytest.CaptureFixture[str]) -> None:
    """Also one that is opened to find out which files are its steps, and files of frames side by side."""
    Path("in/bad.pvd").write_text("<VTKFile", encoding="ascii")
    Path("in/bad.nrrd").write_text("NRRD0004\ntype: none\n\n", encoding="ascii")
    Path("frames").mkdir()
    for k in range(2):
        values = np.broadcast_to(KINDS["uint8"][0][8:40, 8:40, 8:40] // (k + 1), (32, 32, 32)).astype(np.uint8)
        save(Path(f"frames/{k}.dcm"), image_fields(values, uid=f"1.2.{k}", SpacingBetweenSlices="0.5"))
    named = ["in/bad.pvd", "in/bad.nrrd", "steps_{}.nrrd", "gone*.nrrd", "frames", "in/uint8.npy"]
    assert turntable(*named, "--output", "out", *SMALL) == 2
    table = [line.split()[:2] for line in capsys.readouterr().out.splitlines()[1:]]
    good = ["frames/0.dcm", "frames/1.dcm", "in/uint8.npy"]
    assert table == [[name, "failed"] for name in named[:4]] + [[name, "done"] for name in good]
