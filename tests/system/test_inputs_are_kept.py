"""No command overwrites a file that it reads, or one that belongs to somebody else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from PIL import Image
from small_scene import contents, small_scene, small_tree
from volume_files import write_volume

from hsplat_cli import main

pytestmark = pytest.mark.usefixtures("folder")

VALUES = (np.indices((6, 6, 6)).sum(axis=0) * 16).astype(np.uint8)


def scene_of(volume: str | None, error: str = "tolerance: 0.1") -> None:
    """Write a scene of this volume, or of a procedural one."""
    Path("scene.yaml").write_text(small_scene(frames=3, error=error, volume=volume), encoding="utf-8")


def raw(name: str) -> str:
    Path(name).parent.mkdir(exist_ok=True)
    Path(name).write_bytes(VALUES.tobytes())
    return f"raw: {{file: {name}, shape: [6, 6, 6], dtype: uint8}}"


def header(name: str) -> str:
    raw(name)
    text = f"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 6 6 6\nencoding: raw\ndata file: {name}\n"
    Path("scan.nhdr").write_text(text, encoding="ascii")
    return "file: scan.nhdr"


def unfinished(name: str) -> str:
    volume = raw(name)
    Path(name).with_name("lock").write_text("process 1 on host", encoding="ascii")
    return volume


def slices(link: str) -> str:
    Path("slices").mkdir()
    for z in range(3):
        write_volume(Path(f"slices/{z}.tif"), VALUES[z : z + 1], "<")
    Path(link).parent.mkdir(exist_ok=True)
    Path(link).hardlink_to("slices/1.tif")
    return "file: slices"


def linked(link: str, name: str) -> str:
    volume = raw(name)
    Path(link).hardlink_to(name)
    return volume


def refused(capsys: pytest.CaptureFixture[str], output: str, source: str, *arguments: str) -> None:
    """The command ends with this message, and nothing has changed."""
    before = contents()
    assert main.run([*arguments]) == 2
    assert capsys.readouterr().err == (
        f"{output}: this output would overwrite an input\n"
        f"  got: the input {source}\n"
        "  expected: a file that is not read\n"
        "  hint: give the output another name or folder\n"
    )
    assert contents() == before


@pytest.mark.parametrize(
    ("make", "option", "output", "source"),
    [
        (lambda: raw("scan.mp4"), "scan.mp4", "scan.mp4", "scan.mp4"),
        (lambda: raw("film.mp4.json"), "film.mp4", "film.mp4.json", "film.mp4.json"),
        (lambda: raw("frame-0001.png"), "frame-{frame:04}.png", "frame-0001.png", "frame-0001.png"),
        (lambda: raw("frames/frames.json"), "frames/{frame}.png", "frames/frames.json", "frames/frames.json"),
        (lambda: linked("film.gif", "scan.raw"), "film.gif", "film.gif", "scan.raw"),
        (lambda: header("film.mp4"), "film.mp4", "film.mp4", "film.mp4"),
        (lambda: raw("scan.mp4"), "missing/../scan.mp4", "missing/../scan.mp4", "scan.mp4"),
        (
            lambda: unfinished("film.mp4.unfinished/000000.png"),
            "film.mp4",
            "film.mp4.unfinished/000000.png",
            "film.mp4.unfinished/000000.png",
        ),
        (lambda: slices("frames/2.png"), "frames/{frame}.png", "frames/2.png", "slices/1.tif"),
    ],
)
@pytest.mark.parametrize("command", [["render", "--force"], ["render", "--progressive"], ["check"]])
def test_the_volume(make, option, output, source, command, capsys) -> None:
    scene_of(make())
    refused(capsys, output, str(Path(source).resolve()), command[0], "scene.yaml", *command[1:], "--output", option)


def test_the_scene(capsys) -> None:
    scene_of(None)
    Path("film.mp4.json").hardlink_to("scene.yaml")
    refused(capsys, "film.mp4.json", "scene.yaml", "render", "scene.yaml")


def test_the_sidecar(capsys) -> None:
    """It may be written again with its film, but by no other film, and by no frame."""
    scene_of(None)
    assert main.run(["render", "scene.yaml", "--quiet"]) == 0
    assert main.run(["render", "film.mp4.json", "--force", "--quiet", "--output", "film.mp4"]) == 0
    Path("other.mp4").hardlink_to("film.mp4.json")
    refused(capsys, "other.mp4", "film.mp4.json", "render", "film.mp4.json", "--output", "other.mp4")
    before = contents()
    for change in (["--set", "error.tolerance=0.5"], ["--progressive"]):
        assert main.run(["render", "film.mp4.json", "--output", "film.mp4", *change]) == 2
        assert capsys.readouterr().err == (
            "film.mp4.json: this would overwrite the recorded film\n  hint: --output names another file\n"
        )
    assert contents() == before


def test_a_sidecar_that_is_the_volume(capsys) -> None:
    Path("scan.raw").write_bytes(bytes(range(200)) * 100)
    scene_of("raw: {file: scan.raw, shape: [100, 20, 10], dtype: uint8}")
    assert main.run(["render", "scene.yaml", "--quiet"]) == 0
    capsys.readouterr()
    sidecar = Path("film.mp4.json")
    sidecar.write_bytes(sidecar.read_bytes().ljust(100 * 20 * 10))
    command = ["render", "film.mp4.json", "--set", "volume.raw.file=film.mp4.json", "--force"]
    refused(capsys, "film.mp4.json", str(Path("film.mp4.json").resolve()), *command)


def films_of(*names: str) -> None:
    """Write scene.yaml with several outputs, of which the later ones show one frame."""
    outputs = [{"file": names[0]}, *({"file": name, "frame": 1} for name in names[1:])]
    Path("scene.yaml").write_text(yaml.safe_dump(small_tree(frames=2, output=outputs)), "utf-8")


def refusal(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """Return the message of a command that ends with 2 and has changed nothing."""
    before = contents()
    assert main.run([*arguments]) == 2
    assert contents() == before
    return capsys.readouterr().err


@pytest.mark.parametrize("command", [["render"], ["render", "--force"], ["check"]])
def test_outputs_in_each_others_places(command: list[str], capsys) -> None:
    Path("here").symlink_to(".")
    Path("hidden").symlink_to("film.mp4.unfinished")
    for name, what in {
        "here/film.mp4": "output.1.file: the name of two outputs",
        "FILM.mp4": "output.1.file: the name of two outputs",
        "film.mp4.unfinished/still.png": "in a folder for unfinished frames",
        "other.unfinished/still.png": "in a folder for unfinished frames",
        "hidden/still.png": "in a folder for unfinished frames",
        "film.mp4.json/still.png": "the folder of another one",
    }.items():
        films_of("film.mp4", name)
        assert what in refusal(capsys, command[0], "scene.yaml", *command[1:]), name


def test_a_picture_among_pictures_that_are_slices(capsys) -> None:
    """It would be a slice of the volume from then on."""
    Path("slices").mkdir()
    for number in range(4):
        Image.new("L", (8, 8), 60 * number).save(f"slices/{number}.png")
    scene_of("file: slices")
    for name in ("slices/{frame:03}.png", "slices/../slices/film-{frame}.png"):
        message = refusal(capsys, "render", "scene.yaml", "--output", name)
        assert "this output would become a slice of an input" in message
    assert main.run(["render", "scene.yaml", "--quiet", "--output", "slices/film.mp4"]) == 0


def test_a_further_output_of_another_film(capsys) -> None:
    """Whoever comes second is refused, and the first film stays up to date; a film replaces what it has made itself."""
    films_of("one.mp4", "common.png")
    assert main.run(["render", "scene.yaml", "--quiet"]) == 0
    assert main.run(["render", "scene.yaml", "--quiet", "--set", "error.tolerance=0.5"]) == 0
    films_of("two.mp4", "common.png")
    for command in (["check", "scene.yaml"], ["render", "scene.yaml"]):
        message = refusal(capsys, *command)
        assert message.startswith("common.png: this further output exists, and is not of this film")
    films_of("two.mp4", "one.mp4")
    assert "one.mp4: this further output exists" in refusal(capsys, "render", "scene.yaml")
    films_of("two.mp4", "common.png")
    assert main.run(["verify", "one.mp4", "--quiet"]) == 0
    assert main.run(["render", "scene.yaml", "--quiet", "--force"]) == 0
    capsys.readouterr()
    films_of("one.mp4", "common.png")
    assert main.run(["render", "scene.yaml", "--set", "error.tolerance=0.5"]) == 0
    assert "one.mp4 has another common.png beside it than its sidecar describes" in capsys.readouterr().err


def test_further_outputs_of_parts_and_of_moved_films() -> None:
    """Parts of a path know what others have made."""
    outputs = [
        {"file": "film/{frame}.png", "size": [16, 16]},
        {"file": "film/small/{frame}.png"},
    ]
    Path("scene.yaml").write_text(yaml.safe_dump(small_tree(frames=4, output=outputs)), "utf-8")
    for frames in ("0:2", "1:4", ":"):
        assert main.run(["render", "scene.yaml", "--quiet", f"--frames={frames}"]) == 0
    text = Path("scene.yaml").read_text("utf-8")
    Path("scene.yaml").write_text(text.replace("film/", "moved/film/"), "utf-8")
    Path("moved").mkdir()
    Path("film").rename("moved/film")
    assert main.run(["render", "scene.yaml", "--quiet", "--set", "error.tolerance=0.5"]) == 0


def test_a_json_file_of_another_program(capsys) -> None:
    scene_of(None)
    Path("film.mp4.json").write_text('{"streams": []}', "utf-8")
    for command in ("check", "render"):
        assert "something else has the name of the sidecar" in refusal(capsys, command, "scene.yaml")
    assert main.run(["render", "scene.yaml", "--quiet", "--force"]) == 0


@pytest.mark.slow
def test_pages_of_somebody_else(capsys) -> None:
    """Pages of hsplat are replaced."""
    scene_of(None)
    commands = {
        "page.html": ["preview", "scene.yaml", "-o", "page.html"],
        "measured/index.html": ["measure", "scene.yaml", "--output", "measured", "--frames", "0"],
    }
    for name in ("one", "two", "measured"):
        Path(name).mkdir()
    for name in ("one/0.png", "two/0.png"):
        Image.new("RGB", (32, 32)).save(name)
    for page, command in commands.items():
        Path(page).write_text("<p>mine", "utf-8")
        assert f"{page}: another page has this name" in refusal(capsys, *command)
        Path(page).unlink()
    for page, command in commands.items():
        for _ in range(2):
            assert main.run([*command, "--quiet"]) == 0
            assert "mine" not in Path(page).read_text("utf-8")


def test_a_film_beside_its_slices() -> None:
    """It is no slice, and may be drawn again."""
    scene_of(slices("other.tif"))
    for _ in range(2):
        assert main.run(["render", "scene.yaml", "--force", "--quiet", "--output", "slices/{frame}.png"]) == 0
    assert Path("slices/frames.json").exists()


@pytest.mark.parametrize("command", [["render"], ["render", "--force"], ["render", "--progressive"], ["check"]])
def test_a_folder_that_hsplat_did_not_make(command: list[str], capsys) -> None:
    scene_of(None)
    Path("film.mp4.unfinished").mkdir()
    Path("film.mp4.unfinished/000000.png").write_bytes(b"mine")
    before = contents()
    assert main.run([command[0], "scene.yaml", *command[1:]]) == 2
    assert "film.mp4.unfinished: something else has the name of the folder" in capsys.readouterr().err
    assert contents() == before


def test_scenes_and_reports(capsys) -> None:
    write_volume(Path("scan.nrrd"), VALUES, "<")
    Path("films").mkdir()
    for name in ("scan.yaml", "measure.csv", "films/scan.mp4"):
        Path(name).hardlink_to("scan.nrrd")
    refused(capsys, "scan.yaml", "scan.nrrd", "init", "scan.nrrd", "--output", "scan.yaml", "--force")
    scene_of("file: scan.nrrd")
    scan = str(Path("scan.nrrd").resolve())
    refused(capsys, "measure.csv", scan, "measure", "scene.yaml", "--output", ".")
    refused(capsys, "films/scan.mp4", "scan.nrrd", "turntable", "scan.nrrd", "-o", "films")


@pytest.mark.parametrize("output", ["turntable.json", ".turntable.json.lock", "index.html", "scan.yaml", "other.mp4"])
def test_turntables(output: str, capsys) -> None:
    """All volumes are compared with the outputs of all films."""
    header(output)
    write_volume(Path("other.nrrd"), VALUES, "<")
    refused(capsys, output, output, "turntable", "scan.nhdr", "other.nrrd", "-o", ".", "--force")


@pytest.mark.parametrize("options", [[], ["--prune", "--frames", "0"]])
def test_goldens(options: list[str], capsys) -> None:
    scene_of(None)
    assert main.run(["golden", "scene.yaml", "--quiet"]) == 0
    scene_of(raw("goldens/scene/frame-0001.png"))
    source = str(Path("goldens/scene/frame-0001.png").resolve())
    refused(capsys, "goldens/scene/frame-0001.png", source, "golden", "scene.yaml", "--update", "--yes", *options)


@pytest.mark.parametrize(
    ("output", "overwritten", "source"),
    [
        ("parts/{frame}.png", "parts/0.png", "parts/0.png"),
        ("film.mp4", "film.mp4", "parts/frames.0-1.json"),
        ("film.gif", "film.gif.json", "parts/2.png"),
        ("missing/../parts/{frame}.png", "missing/../parts/0.png", "parts/0.png"),
    ],
)
def test_parts_of_films(output: str, overwritten: str, source: str, capsys) -> None:
    scene_of(None)
    for frames in ("0:2", "2:3"):
        assert main.run(["render", "scene.yaml", "--frames", frames, "--output", "parts/{frame}.png", "--quiet"]) == 0
    Path("film.mp4").hardlink_to("parts/frames.0-1.json")
    Path("film.gif.json").hardlink_to("parts/2.png")
    refused(capsys, overwritten, source, "assemble", "parts", "--force", "--output", output)


def test_a_film_assembled_among_its_parts(capsys) -> None:
    """It is none of them, and is assembled again when they have changed."""
    scene_of(None)
    for changes in ([], ["--set", "error.tolerance=0.5"]):
        for frames in ("0:2", "2:3"):
            command = ["render", "scene.yaml", "--frames", frames, "--output", "parts/{frame}.png", "--quiet", *changes]
            assert main.run(command) == 0
        assert main.run(["assemble", "parts", "--output", "parts/whole-{frame}.png", "--quiet"]) == 0
        assert Path("parts/whole-1.png").read_bytes() == Path("parts/1.png").read_bytes()
    assert main.run(["assemble", "parts", "--output", "parts/whole-{frame}.png"]) == 0
    assert "is up to date" in capsys.readouterr().err
