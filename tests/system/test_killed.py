"""A job may be killed at any operation on a file, and two jobs may not write one output."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
import yaml
from commands import HSPLAT, environment, other_process, python
from resuming import assert_clean
from small_scene import contents, engine_block, small_scene, small_tree

from hsplat_cli import main

pytestmark = pytest.mark.usefixtures("scene_folder")

SCENE = small_scene()


def arguments(output: str, *options: str) -> list[str]:
    return ["render", "scene.yaml", "--output", output, *options]


def pictures(folder: str) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in Path(folder).glob("*.png")}


# Runs `hsplat` in a child process of its own that is killed before the operation on files of that number, from
# `first` on in steps; then runs it again. Writes what became of each.
KILLER = """\
import hashlib, json, os, signal, sys
from pathlib import Path
from hsplat_cli import main
first, step, arguments = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:]

EVENTS = ("open", "os.rename", "os.remove", "os.mkdir", "os.rmdir", "os.truncate", "fcntl.lockf", "subprocess.Popen")

def run(kill_before=None):
    child = os.fork()
    if child == 0:
        num_events = 0
        def count(event, values):
            nonlocal num_events
            if event in EVENTS and (event.startswith(("fcntl", "sub")) or str(values[0]).startswith("out")):
                num_events += 1
                if num_events == kill_before:
                    os.kill(os.getpid(), signal.SIGKILL)
        sys.addaudithook(count)
        os._exit(main.run(arguments))
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])

def files():
    found = {}
    for path in sorted(Path("out").rglob("*")):
        whole = path.is_file() and path.suffix != ".json"
        found[str(path)] = hashlib.sha256(path.read_bytes()).hexdigest() if whole else ""
    return found

def clear(path):
    for child in path.iterdir() if path.is_dir() else ():
        clear(child) if child.is_dir() else child.unlink()
    path.is_dir() and path.rmdir()

assert run() == 0
whole, number, num_killed = files(), first, 0
while True:
    clear(Path("out"))
    code = run(number)
    between = files()
    if code == 0:
        break
    assert code == -signal.SIGKILL, (number, code)
    torn = {name for name in between if name in whole and between[name] != whole[name]}
    assert not torn, (number, torn)
    others = {Path(name).parent for name in between if name not in whole and "unfinished" not in name}
    assert not others - {Path(".")}, (number, others)
    assert run() == 0, number
    assert files() == whole, (number, files(), whole)
    number, num_killed = number + step, num_killed + 1
print(num_killed)
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "outputs",
    [
        ["film.mp4"],
        ["{frame}.png"],
        ["film.mp4", "film.gif", "{frame}.png", "far/still.png"],
        ["{frame}.png", "film.webm", "far/small-{frame}.png"],
    ],
)
def test_killed_at_any_operation_on_a_file(outputs: list[str]) -> None:
    """Nothing half-written has a final name, and the next run is right and leaves nothing else."""
    keys = {"far/still.png": {"frame": 1}}
    files = [{"file": f"out/{name}", **keys.get(name, {})} for name in outputs]
    tree = small_tree(frames=2, volume=engine_block(8, 8, 8), output=[{"size": [32, 32], **files[0]}, *files[1:]])
    Path("scene.yaml").write_text(yaml.safe_dump(tree), "utf-8")
    done = python("-c", KILLER, "7", "29", "render", "scene.yaml", "--quiet")
    assert done.stderr == ""
    assert int(done.stdout) >= 2


def started(output: str, *options: str) -> subprocess.Popen[str]:
    command = [*HSPLAT, *arguments(f"out/{output}", *options)]
    return subprocess.Popen(command, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.mark.slow
def test_jobs_with_different_frames_of_one_output() -> None:
    """As in a job array: they work at the same time, and all frames are there in the end."""
    assert main.run(arguments("expected/{frame}.png", "--set", "camera.path.frames=20", "--quiet")) == 0
    with (
        started("{frame}.png", "--set", "camera.path.frames=20", "--frames", "0::2") as first,
        started("{frame}.png", "--set", "camera.path.frames=20", "--frames", "1::2") as second,
    ):
        for process in (first, second):
            process.communicate()
            assert process.returncode == 0
    assert pictures("out") == pictures("expected")
    assert_clean()


def scene_with(*outputs: str) -> str:
    """Return a scene with these outputs of two frames, of which the later ones show the second frame alone."""
    files = [{"file": outputs[0]}, *({"file": name, "frame": 1} for name in outputs[1:])]
    return yaml.safe_dump(small_tree(frames=2, output=files))


@pytest.mark.parametrize("place", [pytest.param("out/common.png", marks=pytest.mark.slow), "link/common.png"])
def test_films_with_a_further_output_in_common(place: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The second one is refused while the first is made, and has not written anything."""
    Path("out").mkdir()
    Path("link").symlink_to("out")
    Path("other.yaml").write_text(scene_with("a.mp4", "out/common.png"), "utf-8")
    Path("scene.yaml").write_text(scene_with("b.mp4", "c.png", place), "utf-8")
    imports = "import renderer\nfrom renderer.film import locked_output\nscene = renderer.load_scene('other.yaml')"
    with other_process(imports, "locked_output(scene.output, range(2), Path('a.mp4.json'))"):
        before = contents()
        assert main.run(["render", "scene.yaml"]) == 2
        assert contents() == before
        message = capsys.readouterr().err
        assert message.startswith(f"{place}: another job is writing this output\n  got: process ")
        # Only frame 1 is in the common file.
        assert main.run(["render", "scene.yaml", "--frames", "0", "--quiet"]) == 0
    assert main.run(["render", "scene.yaml", "--quiet"]) == 0


def test_two_templates_with_one_folder_for_unfinished_work() -> None:
    tree = small_tree(frames=2, output=[{"file": "{frame}.png"}, {"file": "{frame}.exr"}])
    Path("scene.yaml").write_text(yaml.safe_dump(tree), "utf-8")
    assert main.run(["render", "scene.yaml", "--quiet"]) == 0
    assert sorted(each.name for each in Path().iterdir()) == [
        *("0.exr", "0.png", "1.exr", "1.png"),
        *("frames.json", "scene.yaml"),
    ]
