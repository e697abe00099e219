"""Records name files relative to themselves: folders that move together stay usable, and no name begins at the root."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from small_scene import edit_sidecar, sidecar, small_scene, small_tree

from hsplat_cli import main
from renderer.scene import found_path, relative_path

SCENE = small_scene(frames=3, volume='file: "scans/scan.npy"')
RAW = "raw: {file: scans/scan.npy, shape: [12, 12, 12], dtype: float32, offset: 128}"


@pytest.fixture(autouse=True)
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the current folder, with a scene of a scan in a folder below."""
    folder = tmp_path / "project"
    (folder / "scans").mkdir(parents=True)
    monkeypatch.chdir(folder)
    grid = np.mgrid[-1:1:12j, -1:1:12j, -1:1:12j]
    np.save("scans/scan.npy", (255 * (1 - np.abs(grid).max(axis=0))).astype(np.float32))
    Path("scene.yaml").write_text(SCENE, encoding="utf-8")
    return folder


def run(*arguments: str) -> None:
    assert main.run([*arguments, "--quiet"]) == 0


def absolute_paths(data: Any, place: str = "") -> Iterator[str]:
    """Yield the places of texts that begin at the root."""
    items = data.items() if isinstance(data, dict) else enumerate(data if isinstance(data, list) else ())
    for key, value in items:
        yield from absolute_paths(value, f"{place}.{key}")
    is_message = place.endswith((".error", ".command"))  # as it was printed, or is to be typed
    if isinstance(data, str) and data.startswith("/") and not is_message:
        yield f"{place}: {data}"


def told(name: str) -> dict[str, Any]:
    """Return a record, in which no path is absolute."""
    found: dict[str, Any] = json.loads(Path(name).read_text("utf-8"))
    assert list(absolute_paths(found)) == []
    return found


@pytest.mark.parametrize(
    ("file", "folder", "name"),
    [
        ("a/b/scan.npy", "a/film", "../b/scan.npy"),
        ("a/film/film.mp4", "a/film", "film.mp4"),
        ("a/film", "a/film", "."),
        (".", "a/film", "../.."),
        ("link/../b/scan.npy", "a/film", "../b/scan.npy"),  # the system goes through the link first
        ("a/b/scan.npy", "link", "../b/scan.npy"),
        ("a/latest.npy", "a/film", "../latest.npy"),  # which is a link itself
        ("/dev/null", ".", None),
    ],
)
def test_paths_and_their_names(file: str, folder: str, name: str | None) -> None:
    for made in ("a/b", "a/film"):
        Path(made).mkdir(parents=True)
    Path("a/b/scan.npy").touch()
    Path("link").symlink_to("a/film")
    Path("a/latest.npy").symlink_to("b/scan.npy")
    for given in (file, Path(file).absolute()):
        found = relative_path(given, folder)
        assert found == (name or found) and not Path(found).is_absolute()
        assert Path(folder, found).resolve() == Path(file).resolve()
        assert Path(found_path(found, folder)).resolve() == Path(file).resolve()
        assert not found_path(found, folder).startswith("..")


def test_a_name_that_goes_above_the_root() -> None:
    assert found_path("../" * 1_000_000 + "etc", "films") == "/etc"


@pytest.mark.parametrize("output", ["film.mp4", "films/film.mp4", "/films/{frame}.png"])
@pytest.mark.parametrize("volume", ['file: "scans/scan.npy"', RAW])
def test_a_film_moves_with_its_volume(output: str, volume: str, project: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However the output was named, and wherever the user stands by then."""
    Path("scene.yaml").write_text(small_scene(frames=3, volume=volume), encoding="utf-8")
    run("render", "scene.yaml", "--output", f"{project}{output}" if output.startswith("/") else output)
    (record,) = (path for path in project.rglob("*.json"))
    shown = told(str(record))
    section, up = shown["scene"]["volume"], "../" * (record.parent != project)
    assert section.get("raw", section)["file"] == f"{up}scans/scan.npy"
    assert shown["scene"]["output"]["file"] == Path(output).name
    assert shown["volume"]["name"] == "scan.npy"
    pictures = {path.name: path.read_bytes() for path in record.parent.glob("*.[mp][pn][4g]")}
    for name in pictures:
        (record.parent / name).unlink()
    moved = project.rename(project.with_name("elsewhere"))
    monkeypatch.chdir(moved.parent)
    again = moved / record.relative_to(project)
    run("render", str(again))
    assert {path.name: path.read_bytes() for path in again.parent.glob("*.[mp][pn][4g]")} == pictures
    run("verify", str(again))


def test_a_film_without_its_volume_says_what_is_missing(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run("render", "scene.yaml", "--output", "films/film.mp4")
    content = Path("films/film.mp4").read_bytes()
    Path("films/film.mp4").unlink()
    Path("scans").rename("moved")
    assert main.run(["render", "films/film.mp4.json"]) == 2
    assert capsys.readouterr().err == (
        "films/film.mp4.json: scene.volume.file: no such file\n"
        f"  got: {project}/scans/scan.npy\n"
        "  expected: a file such as NRRD, NIfTI, TIFF, DICOM or .npy, or a folder with one volume\n"
        "  hint: if it was moved, --volume names it\n"
    )
    run("render", "films/film.mp4.json", "--volume", "moved/scan.npy")
    assert Path("films/film.mp4").read_bytes() == content
    assert told("films/film.mp4.json")["scene"]["volume"]["file"] == "../moved/scan.npy"


def test_further_files_of_a_scene() -> None:
    """Masks, logos and other outputs; a film whose logo has moved is up to date."""
    np.save("scans/mask.npy", np.ones((12, 12, 12), np.uint8))
    Path("scans/names.ctbl").write_text("1 a 9 9 9 255\n")
    Image.new("RGB", (4, 4), "red").save("logo.png")
    tree = small_tree(
        frames=3,
        volume={"file": "scans/scan.npy"},
        mask={"file": "scans/mask.npy", "names": "scans/names.ctbl", "show": [1]},
        annotation={"logo": "logo.png"},
        output=[{"file": "films/film.mp4", "size": [64, 64]}, {"file": "stills/0.png", "frame": 0}],
    )
    Path("scene.json").write_text(json.dumps(tree), "utf-8")
    run("render", "scene.json")
    shown = told("films/film.mp4.json")
    assert shown["scene"]["mask"]["file"] == "../scans/mask.npy"
    assert shown["scene"]["annotation"]["logo"]["file"] == "../logo.png"
    assert [each["file"] for each in shown["scene"]["output"]] == ["film.mp4", "../stills/0.png"]
    assert shown["outputs"][0]["file"] == "../stills/0.png"
    assert shown["fingerprint"]["depends_on"]["scene"]["annotation"]["logo"]["file"] == "logo.png"
    drawn = Path("films/film.mp4").stat().st_mtime_ns
    Path("logo.png").rename("scans/logo.png")
    Path("scene.json").write_text(json.dumps(tree | {"annotation": {"logo": "scans/logo.png"}}), "utf-8")
    run("render", "scene.json")
    assert Path("films/film.mp4").stat().st_mtime_ns == drawn


def test_an_assembled_film_has_its_own_places() -> None:
    """Its parts lie in other folders, at other depths."""
    run("render", "scene.yaml", "--output", "work/a/{frame}.png", "--frames", "0:2")
    run("render", "scene.yaml", "--output", f"{Path.cwd()}/b/{{frame}}.png", "--frames", "2:3")
    run("assemble", "work/a", "b", "--output", "films/film.mp4")
    shown = told("films/film.mp4.json")
    assert shown["scene"]["volume"]["file"] == "../scans/scan.npy"
    assert [part["sidecar"] for part in shown["parts"]] == ["../work/a/frames.0-1.json", "../b/frames.2.json"]
    film = Path("films/film.mp4").read_bytes()
    Path("films/film.mp4").unlink()
    run("render", "films/film.mp4.json")
    assert Path("films/film.mp4").read_bytes() == film


def test_a_study(project: Path) -> None:
    quick = ("--thorough", "--repeats", "1", "--frames", "0", "--tolerances", "1", "--footprints", "integrated")
    run("measure", f"{project}/scene.yaml", *quick, "--measures", "optical", "--output", "studies/one")
    assert told("studies/one/measure.json")["scene"]["volume"]["file"] == "../../scans/scan.npy"


def test_turntables(project: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The table for the terminal has names that one can open from where one stands."""
    Path("scans/broken.npy").write_bytes(b"no numbers")
    volumes = [f"{project}/scans/broken.npy", "scans/scan.npy"]
    arguments = ["--output=films", "--frames=2", "--size=32", "--quiet"]
    assert main.run(["turntable", *volumes, *arguments]) == 2
    films = {film["volume"]: film for film in told("films/turntable.json")["films"]}
    assert films["../scans/broken.npy"]["status"] == "failed"
    done = films["../scans/scan.npy"]
    assert (done["scene"], done["film"], done["status"]) == ("scan.yaml", "scan.mp4", "done")
    assert told("films/scan.mp4.json")["scene"]["volume"]["file"] == "../scans/scan.npy"
    rows = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert [row[0] for row in rows[1:3]] == ["scans/broken.npy", "scans/scan.npy"]
    assert rows[2][-1] == "films/scan.mp4"


def test_goldens() -> None:
    run("golden", "scene.yaml")
    (origin,) = told("goldens/scene/golden.json")["origins"]
    assert origin["volume"]["name"] == "scan.npy"


def test_records_of_another_version(capsys: pytest.CaptureFixture[str]) -> None:
    """They are refused in one sentence; beside an output they count as none."""
    run("render", "scene.yaml")
    edit_sidecar("film.mp4.json", lambda data: data.update(format="hsplat film 1"))
    for command in (["render", "film.mp4.json"], ["verify", "film.mp4"]):
        assert main.run(command) == 2
        said = capsys.readouterr().err
        assert said.startswith("film.mp4.json: a sidecar of another version of hsplat\n"), command
    assert main.run(["render", "scene.yaml"]) == 0
    assert "film.mp4.json is not a record that can be used: a sidecar of another" in capsys.readouterr().err
    assert sidecar()["format"] == "hsplat film 2"
