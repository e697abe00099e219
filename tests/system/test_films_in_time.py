"""Films of volumes that change in time: which step a frame shows, and what is said of steps that are wrong."""

from __future__ import annotations

import json
import weakref
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import numpy as np
import pytest
from small_scene import small_scene

from hsplat_cli import main
from renderer.frame import draw_frame
from renderer.layers import make_layer
from renderer.readers import RecentImages
from renderer.scene import load_scene

# The function that decodes the voxels of a file of several steps.
DECODED = "renderer.readers.stored._decoded"
# The function that finds the reader of a file.
READER = "renderer.readers.volume_reading.import_reader"
NUM_STEPS, NUM_FRAMES = 4, 7
SCENE = small_scene(frames=NUM_FRAMES, size="32, 24", volume="file: 's_{}.npy', time: auto")

pytestmark = pytest.mark.usefixtures("scene_folder")


def ball(radius: float) -> np.ndarray[Any, np.dtype[np.uint8]]:
    z, y, x = np.indices((16, 16, 16)) - 7.5
    return np.asarray(np.clip(40 * (radius - np.sqrt(x * x + y * y + z * z)) + 100, 0, 255), np.uint8)


@pytest.fixture(autouse=True)
def steps(scene_folder: None) -> None:
    for step in range(NUM_STEPS):
        np.save(f"s_{step}.npy", ball(2 + 1.5 * step))


def render(*arguments: str) -> None:
    assert main.run(["render", *arguments, "--quiet"]) == 0


def film(name: str, *changes: str, arguments: tuple[str, ...] = ()) -> list[bytes]:
    asked = [part for change in changes for part in ("--set", change)]
    render("scene.yaml", *asked, "--output", f"{name}/{{frame}}.png", *arguments)
    return [Path(f"{name}/{frame}.png").read_bytes() for frame in range(NUM_FRAMES)]


def told(name: str) -> dict[str, Any]:
    data: dict[str, Any] = json.loads(Path(f"{name}/frames.json").read_text("utf-8"))
    return data


def still(frame: int, camera: dict[str, Any], *changes: str) -> bytes:
    """A frame of a film of one step, which the changes name."""
    place = f"camera.target={camera['target']}", f"camera.distance={camera['distance']}"
    asked = [part for change in (*place, *changes) for part in ("--set", change)]
    render("scene.yaml", *asked, "--frames", str(frame), "--output", "still.png", "--force")
    return Path("still.png").read_bytes()


def test_all_steps_over_the_film() -> None:
    """By the nearest, framed by the voxels that are visible on any frame."""
    pictures = film("all")
    record = told("all")
    assert record["scene"]["volume"]["time"] == {"0": 0, "6": 3}
    assert [frame["values"]["volume.time"] for frame in record["frames"]] == [0, 1, 1, 2, 2, 3, 3]
    for frame, step in ((0, 0), (1, 1), (4, 2), (6, 3)):
        assert pictures[frame] == still(frame, record["camera"], f"volume.time={step}")
    largest = film("one", "volume.time=3")
    assert told("one")["camera"]["distance"] == pytest.approx(record["camera"]["distance"])
    assert largest[6] == pictures[6]


def test_between_steps() -> None:
    pictures = film("mixed", "volume.interpolate=true")
    assert len(set(pictures)) == NUM_FRAMES
    values = [frame["values"]["volume.time"] for frame in told("mixed")["frames"]]
    assert values == [0.5 * frame for frame in range(NUM_FRAMES)]
    np.save("between.npy", (np.load("s_0.npy").astype(np.float32) + np.load("s_1.npy").astype(np.float32)) / 2)
    assert pictures[1] == still(1, told("mixed")["camera"], "volume={file: between.npy}")


@pytest.mark.slow
def test_however_it_is_made(scheduler: str) -> None:
    expected = film("film")
    assert film("cluster", arguments=("--scheduler", scheduler)) == expected
    render("film/frames.json", "--output", "again/{frame}.png")
    assert [Path(f"again/{frame}.png").read_bytes() for frame in range(NUM_FRAMES)] == expected
    assert main.run(["verify", "film/frames.json", "--quiet"]) == 0


def test_a_file_of_several_steps(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """It is decoded once, and `turntable` shows all of them."""
    import nibabel as nib

    decoded, decode = list[object](), resolve_name(DECODED)
    monkeypatch.setattr(DECODED, lambda *arguments: decoded.append(arguments) or decode(*arguments))

    stack = np.stack([np.load(f"s_{step}.npy").T for step in range(NUM_STEPS)], axis=-1)
    nib.save(nib.Nifti1Image(stack, np.diag([-1.0, -1.0, 1.0, 1.0])), "four.nii.gz")  # type: ignore[attr-defined]
    assert film("of one file", "volume.file=four.nii.gz") == film("of several")
    assert len(decoded) == 1
    assert main.run(["turntable", "four.nii.gz", "-o", "films", "--frames", "5", "--size", "32"]) == 0
    scene = load_scene(Path("films/four.yaml"))
    assert scene.layers[0].volume.time == "auto"
    assert "range of 4 that were read" in capsys.readouterr().err


@pytest.mark.parametrize("most_bytes", [1e9, 2.5 * 16**3])
def test_each_step_is_read_once_if_there_is_room(most_bytes: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Though its fingerprint, the framing and the drawing need it. Where there is room for two steps, these stay."""
    calls, find = list[Path](), resolve_name(READER)

    def counted(reader: str) -> Any:
        return lambda path, *choice: (calls.append(path), find(reader)(path, *choice))[1]

    expected = film("before")
    images = RecentImages(lambda _: most_bytes)
    monkeypatch.setattr("renderer.readers.volume_reading._RECENT_IMAGES", images)
    monkeypatch.setattr(READER, counted)
    assert film("after") == expected
    by_step = [sum(path.name == f"s_{step}.npy" for path in calls) for step in range(NUM_STEPS)]
    assert by_step[:2] == [1, 1]
    assert (by_step == [1] * NUM_STEPS) == (most_bytes == 1e9)


def test_turntable_reads_a_volume_once(monkeypatch: pytest.MonkeyPatch) -> None:
    calls, find = list[str](), resolve_name(READER)
    monkeypatch.setattr(READER, lambda reader: (calls.append(reader), find(reader))[1])
    assert main.run(["turntable", "s_0.npy", "-o", "films", "--frames", "3", "--size", "32", "--quiet"]) == 0
    assert len(calls) == 1


def test_labels_of_all_steps() -> None:
    """Of which a step may lack some; a map may begin at the last step."""
    for step in range(NUM_STEPS):
        np.save(f"s_{step}.npy", np.where(ball(6.0) > 100, 1 + step % 2, 0).astype(np.uint8))
    labels = "transfer_function=null", "labels={opacity: 0.9}"
    film("labels", *labels, "volume.time={0: 3, 6: 0}")
    assert told("labels")["scene"]["labels"]["show"] == [1, 2]
    film("mask", "mask={file: 's_{}.npy', time: {0: 3, 6: 0}}")
    assert told("mask")["scene"]["mask"]["show"] == [1, 2]


@pytest.mark.slow
@pytest.mark.parametrize("change", ["volume.time.easing=in", "volume.time={0: 0, 3: 3}", "volume.interpolate=true"])
def test_other_steps_are_another_film(change: str) -> None:
    """Also where the same ones are read."""
    digests = []
    for changes in ([], [], [change]):
        film("film", "volume.time={0: 0, 6: 3}", *changes)
        digests.append(told("film")["fingerprint"]["frames_digest"])
    assert digests[0] == digests[1] != digests[2]


def test_another_step_is_another_film(capsys: pytest.CaptureFixture[str]) -> None:
    before = film("film")
    np.save("s_2.npy", ball(6.0))
    assert main.run(["render", "film/frames.json"]) != 0
    assert "the film was made from another volume" in capsys.readouterr().err
    assert film("film") != before


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda: np.save("s_2.npy", ball(3.0)[:15]), "the steps of this volume differ"),
        (lambda: np.save("s_2.npy", ball(3.0).astype(np.float32)), "the steps of this volume differ"),
        (lambda: Path("s_2.npy").write_bytes(Path("s_2.npy").read_bytes()[:-9]), "s_2.npy"),
        (lambda: Path("s_2.npy").unlink(), "no step 2 of 0 to 3"),
    ],
)
def test_wrong_steps_are_found_before_anything_is_drawn(change: Any, message: str, capsys) -> None:
    change()
    assert main.run(["render", "scene.yaml", "--output", "out/{frame}.png"]) != 0
    assert message in capsys.readouterr().err
    assert not Path("out/0.png").exists()


def test_a_step_that_changes_meanwhile(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    expected = film("expected")

    def draw_and_change(*arguments: Any) -> Any:
        frame = draw_frame(*arguments)
        if frame.number == 1:
            np.save("s_3.npy", ball(4.0))
        return frame

    original = np.load("s_3.npy")
    with monkeypatch.context() as patch:
        patch.setattr("renderer.frame.pipeline.draw_frame", draw_and_change)
        assert main.run(["render", "scene.yaml", "--output", "out/{frame}.png"]) != 0
    said = capsys.readouterr().err
    assert "was changed while its film is made" in said and "resumes there" in said
    np.save("s_3.npy", original)
    assert film("out") == expected


def test_each_step_is_made_once_and_few_are_held(monkeypatch: pytest.MonkeyPatch) -> None:
    made, held = list[int](), list[int]()

    def count(*arguments: Any, **options: Any) -> Any:
        layer = make_layer(*arguments, **options)
        made.append(id(layer))
        held.append(len(alive := [each for each in layers if each() is not None]) + 1)
        layers[:] = [*alive, weakref.ref(layer.pyramid)]
        return layer

    layers: list[Any] = []
    film("first", "camera.distance=60", "camera.target=[7, 7, 7]")
    monkeypatch.setattr("renderer.frame.preparation.make_layer", count)
    # It makes layers of some of the voxels.
    monkeypatch.setattr("renderer.job.film_making.look_ahead", lambda *_, **__: [])
    film("film", "camera.distance=61", "camera.target=[7, 7, 7]", "error.probes=0")
    assert len(made) == NUM_STEPS and max(held) <= 3
