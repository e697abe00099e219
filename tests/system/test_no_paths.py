"""Sidecars and reports without paths: folders stay private, and films resume and are drawn again all the same."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_scene import edit_sidecar, sidecar, small_scene

import renderer
from hsplat_cli import main

SECRET = "Jane Doe 1970-01-01"
SCENE = small_scene(frames=3, volume=f'file: "{SECRET}/scan.npy"')


@pytest.fixture(autouse=True)
def private_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the current folder, whose path and whose folder of scans are private, with a scene of a scan."""
    folder = tmp_path / SECRET
    (folder / SECRET).mkdir(parents=True)
    monkeypatch.chdir(folder)
    grid = np.mgrid[-1:1:12j, -1:1:12j, -1:1:12j]
    np.save(Path(SECRET, "scan.npy"), (255 * (1 - np.abs(grid).max(axis=0))).astype(np.float32))
    Path("scene.yaml").write_text(SCENE, encoding="utf-8")
    return folder


def run(*arguments: str) -> None:
    assert main.run([*arguments, "--quiet"]) == 0


def secrets(data: Any, place: str = "") -> Iterator[str]:
    """Yield the places of private text, and of absolute paths."""
    if isinstance(data, dict):
        for key, value in data.items():
            yield from secrets(value, f"{place}.{key}")
    elif isinstance(data, list):
        for index, value in enumerate(data):
            yield from secrets(value, f"{place}.{index}")
    elif isinstance(data, str) and (SECRET in data or "Doe" in data or data.startswith("/")):
        yield f"{place}: {data}"


def assert_no_secret(*files: str | Path) -> None:
    for file in files:
        text = Path(file).read_text(encoding="utf-8")
        assert "Doe" not in text, file
        if Path(file).suffix == ".json":
            assert list(secrets(json.loads(text))) == []


def test_a_sidecar_has_paths_unless_told_otherwise() -> None:
    run("render", "scene.yaml")
    assert sidecar()["volume"]["name"] == str(Path.cwd() / SECRET / "scan.npy")
    assert len(list(secrets(sidecar()))) == 2


@pytest.mark.parametrize("how", [["--no-paths"], ["--set", "output.record_paths=false"]])
def test_a_film_without_paths(how: list[str]) -> None:
    run("render", "scene.yaml", "--output", f"{Path.cwd()}/films/film.mp4", *how)
    assert_no_secret("films/film.mp4.json")
    data = sidecar("films/film.mp4.json")
    assert data["volume"]["name"] == data["scene"]["volume"]["file"] == "scan.npy"
    assert data["scene"]["output"]["file"] == "film.mp4"


def test_masks_have_no_paths() -> None:
    """Nor do tables of the names of their labels, even where only numbers are shown."""
    np.save(Path(SECRET, "mask.npy"), np.ones((12, 12, 12), np.uint8))
    Path(SECRET, "names.ctbl").write_text("1 a 9 9 9 255\n")
    mask = f'{{file: "{SECRET}/mask.npy", names: "{SECRET}/names.ctbl", show: [1]}}'
    Path("scene.yaml").write_text(f"{SCENE}\nmask: {mask}\n", encoding="utf-8")
    run("render", "scene.yaml", "--no-paths")
    assert_no_secret("film.mp4.json")
    assert sidecar()["scene"]["mask"] == {"file": "mask.npy", "nodata": "auto", "show": [1]}


def test_a_film_that_is_up_to_date_loses_its_paths_and_is_not_drawn_again(capsys) -> None:
    run("render", "scene.yaml")
    before, drawn = sidecar(), Path("film.mp4").stat().st_mtime_ns
    assert main.run(["render", "scene.yaml", "--no-paths"]) == 0
    assert "up to date" in capsys.readouterr().err
    assert_no_secret("film.mp4.json")
    assert sidecar()["frames"] == before["frames"]
    assert Path("film.mp4").stat().st_mtime_ns == drawn
    assert main.run(["render", "scene.yaml", "--no-paths"]) == 0
    assert "up to date" in capsys.readouterr().err
    assert_no_secret("film.mp4.json")


def test_frames_resume_without_paths() -> None:
    run("render", "scene.yaml", "--output", "{frame}.png", "--no-paths")
    before = sidecar("frames.json")["frames"]
    Path("1.png").unlink()
    run("render", "scene.yaml", "--output", "{frame}.png", "--no-paths")
    after = sidecar("frames.json")["frames"]
    assert [one == other for one, other in zip(before, after, strict=True)] == [True, False, True]
    assert_no_secret("frames.json")


def test_a_film_is_drawn_again_from_a_sidecar_beside_its_volume(private_folder: Path) -> None:
    run("render", "scene.yaml", "--no-paths", "--output", f"{SECRET}/film.mp4")
    film = Path(SECRET, "film.mp4")
    content = film.read_bytes()
    film.unlink()
    run("render", f"{SECRET}/film.mp4.json")
    assert film.read_bytes() == content
    assert_no_secret(f"{SECRET}/film.mp4.json")


def test_a_sidecar_away_from_its_volume_says_what_is_missing(capsys: pytest.CaptureFixture[str]) -> None:
    run("render", "scene.yaml", "--no-paths")
    content = Path("film.mp4").read_bytes()
    Path("film.mp4").unlink()
    assert main.run(["render", "film.mp4.json"]) == 2
    assert capsys.readouterr().err == (
        "film.mp4.json: scene.volume.file: no such file\n"
        f"  got: {Path.cwd()}/scan.npy\n"
        "  expected: a file such as NRRD, NIfTI, TIFF, DICOM or .npy, or a folder with one volume\n"
        "  hint: the sidecar was written without paths: --volume names it\n"
    )
    run("render", "film.mp4.json", "--volume", f"{SECRET}/scan.npy")
    assert Path("film.mp4").read_bytes() == content
    assert_no_secret("film.mp4.json")


def test_raw_voxels_have_no_path() -> None:
    raw = f'raw: {{file: "{SECRET}/scan.npy", shape: [12, 12, 12], dtype: float32, offset: 128}}'
    Path("scene.yaml").write_text(small_scene(frames=3, volume=raw), encoding="utf-8")
    run("render", "scene.yaml", "--no-paths")
    assert_no_secret("film.mp4.json")
    assert sidecar()["scene"]["volume"]["raw"]["file"] == "scan.npy"


def test_an_assembled_film_has_the_paths_of_neither_volume_nor_parts(capsys: pytest.CaptureFixture[str]) -> None:
    parts = f"{Path.cwd()}/parts"
    run("render", "scene.yaml", "--output", f"{parts}/{{frame}}.png", "--frames", "0:2", "--no-paths")
    run("render", "scene.yaml", "--output", f"{parts}/{{frame}}.png", "--frames", "2:3")
    run("assemble", parts, "--output", "film.mp4", "--no-paths")
    assert_no_secret("film.mp4.json")
    assert [part["sidecar"] for part in sidecar()["parts"]] == ["frames.0-1.json", "frames.2.json"]
    run("assemble", parts, "--output", "with.mp4", "--force")
    assert_no_secret("with.mp4.json")  # as the first part
    assert "Doe" not in capsys.readouterr().err


def test_a_study_without_paths() -> None:
    quick = ("--thorough", "--repeats", "1", "--frames", "0", "--tolerances", "1", "--footprints", "integrated")
    run("measure", "scene.yaml", *quick, "--measures", "optical", "--no-paths", "--output", "study")
    assert_no_secret(*Path("study").iterdir())
    assert len(list(Path("study").iterdir())) == 3


def test_turntables_without_paths() -> None:
    Path(SECRET, "broken.npy").write_bytes(b"no numbers")
    volumes = [f"{Path.cwd()}/{SECRET}/{name}.npy" for name in ("broken", "scan")]
    arguments = ["--output=films", "--frames=2", "--size=32", "--no-paths", "--quiet"]
    assert main.run(["turntable", *volumes, *arguments]) == 2
    assert_no_secret("films/turntable.json", "films/scan.mp4.json", "films/index.html")
    films = {film["volume"]: film for film in json.loads(Path("films/turntable.json").read_text())["films"]}
    assert films["broken.npy"]["status"] == "failed"
    assert films["broken.npy"]["error"]
    assert (films["scan.npy"]["film"], films["scan.npy"]["status"]) == ("scan.mp4", "done")


def test_reports_of_a_comparison_without_paths(private_folder: Path) -> None:
    run("render", "scene.yaml", "--output", "golden/{frame}.png")
    run("render", "scene.yaml", "--output", "actual/{frame}.png", "--set", "error.tolerance=1")
    Path("golden/9.jpg").touch()  # which is not compared, as a note says
    reports = ["--json=c.json", "--junit=c.xml", "--html=c.html", "--no-paths", "--quiet"]
    assert main.run(["compare", f"{private_folder}/golden", f"{private_folder}/actual", *reports]) == 1
    assert_no_secret("c.json", "c.xml", "c.html")
    assert json.loads(Path("c.json").read_text())["golden"] == "golden"
    assert "in golden" in json.loads(Path("c.json").read_text())["notes"][0]
    Path("actual/1.png").write_bytes(b"no picture")
    assert main.run(["compare", f"{private_folder}/golden", f"{private_folder}/actual", *reports]) == 2
    assert_no_secret("c.json", "c.xml")
    assert json.loads(Path("c.json").read_text())["error"]


def test_reports_without_paths_name_limits(private_folder: Path) -> None:
    for name, tolerance in (("golden", 0.1), ("actual", 1)):
        run("render", "scene.yaml", "--output", f"{name}/{{frame}}.png", "--set", f"error.tolerance={tolerance}")
    Path("golden/compare.yaml").write_text("limits: {largest: 1}\nframes: {0.png: {largest: 0}}\n", encoding="utf-8")
    reports = ["--json=c.json", "--junit=c.xml", "--html=c.html", "--no-paths", "--quiet"]
    for sides, level in (("{}", []), ("{}/0.png", []), ("{}/{{frame}}.png", ["--level=cross-driver"])):
        files = [f"{private_folder}/{sides.format(name)}" for name in ("golden", "actual")]
        assert main.run(["compare", *files, *level, *reports]) == 1
        assert_no_secret("c.json", "c.xml", "c.html")
        text = Path("c.json").read_text()
        assert "by golden/compare.yaml" in text or "by compare.yaml" in text or "limits of compare.yaml" in text


def test_goldens_have_no_paths() -> None:
    run("golden", "scene.yaml", "goldens")
    assert_no_secret("goldens/golden.json")


def test_the_python_api_obeys_the_scene(private_folder: Path) -> None:
    Path("scene.yaml").write_text(f"{SCENE}  record_paths: false\n", encoding="utf-8")
    film = renderer.render("scene.yaml", output=private_folder / "film.gif")
    assert_no_secret(film.sidecar)


def test_a_damaged_sidecar_of_a_film_that_is_up_to_date_is_written_again() -> None:
    run("render", "scene.yaml")
    edit_sidecar("film.mp4.json", lambda data: data["scene"].update(volume=[str(Path("scan.npy").absolute())]))
    run("render", "scene.yaml", "--no-paths")
    assert_no_secret("film.mp4.json")
