"""The Python API draws and writes the same bytes as the command, and protects the same files."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import environment, other_process
from kinds_of_data import KINDS
from small_scene import sidecar, small_scene

import renderer
from hsplat_cli import main
from renderer.film import encode_png
from renderer.scene import parse_scene_content

NUM_FRAMES = 3
# The default footprint first.
ERRORS = [(None, None), (None, "psnr: 30"), ("gaussian", "splats: 200")]


@pytest.fixture(autouse=True)
def _folder(folder: Path) -> None:
    write_scene()


def write_scene(footprint: str | None = None, error: str | None = None) -> None:
    Path("scene.yaml").write_text(small_scene(frames=NUM_FRAMES, error=error, footprint=footprint), encoding="utf-8")


def command(*options: str, scene: str = "scene.yaml") -> None:
    assert main.run(["render", scene, "--quiet", *options]) == 0


def blob() -> np.ndarray[Any, np.dtype[np.float32]]:
    """A soft ball with a wave in it."""
    z, y, x = np.meshgrid(*(np.linspace(-1, 1, num) for num in (12, 14, 16)), indexing="ij")
    values: np.ndarray[Any, np.dtype[np.float32]] = (200 * np.exp(-4 * (x * x + y * y + z * z)) + 20 * x).astype("f4")
    return values


@pytest.mark.parametrize(("footprint", "error"), ERRORS)
def test_frames_are_those_of_the_command(footprint: str | None, error: str | None) -> None:
    write_scene(footprint, error)
    command("--output", "{frame}.png", "--frames", "1")
    image = renderer.render_frame("scene.yaml", 1)
    assert (image.dtype, image.shape) == (np.uint8, (32, 32, 3))
    assert image.max() > 100
    assert image._repr_png_() == Path("1.png").read_bytes()
    np.testing.assert_array_equal(renderer.render_frame(renderer.load_scene("scene.yaml"), 1 - NUM_FRAMES), image)


@pytest.mark.parametrize("frames", [slice(None, None, 2), [0, -1]])
def test_numbered_pictures_of_some_frames(frames: Any) -> None:
    film = renderer.render("scene.yaml", output="{frame:02}.png", frames=frames)
    assert (film.path, film.frames, film.sidecar) == (Path("{frame:02}.png"), (0, 2), Path("frames.0-2-by-2.json"))
    command("--output", "other/{frame:02}.png", "--frames", "::2")
    for name in ("00.png", "02.png"):
        assert Path(name).read_bytes() == Path("other", name).read_bytes()
    shown = film._repr_html_()
    assert "image/png" in shown and "2 frames" in shown
    assert film.accuracy is not None
    assert f"off by {255 * 10 ** (-film.accuracy.psnr / 20):.2g} of 255 levels" in shown


def test_an_array_is_drawn_like_its_file() -> None:
    """Also where the scene is what `hsplat init` suggests: `suggest_scene` reads the file or takes the array."""
    array = blob()
    array[0] = np.nan
    np.save("scan.npy", array)
    assert main.run(["init", "scan.npy", "--size", "48x32", "--frames", "120", "--output", "init.yaml"]) == 0
    suggested = renderer.load_scene("init.yaml")
    of_file = renderer.suggest_scene("scan.npy", size=(48, 32), output="scan.mp4")
    assert of_file.with_layers(volume=suggested.layers[0].volume) == suggested
    image = renderer.render_frame(renderer.suggest_scene(array, size=(48, 32)), 40)
    assert image.max() > 50
    np.testing.assert_array_equal(image, renderer.render_frame(of_file, 40))


@pytest.mark.parametrize(
    "change", [lambda a: a, lambda a: a[::-1, :, ::2], lambda a: a.astype(">f4"), np.asfortranarray]
)
def test_arrays_are_never_changed(change: Any) -> None:
    array = change(blob())
    array.flags.writeable = True
    before = array.copy()
    renderer.render_frame(array, size=(16, 16))
    assert array.flags.writeable
    np.testing.assert_array_equal(array, before)


def test_the_film_of_an_array_needs_it_as_a_file(capfd: pytest.CaptureFixture[str]) -> None:
    """Its sidecar tells what the array was, and the command what to do about it."""
    film = renderer.render(renderer.suggest_scene(blob(), size=(16, 16), output="film.gif"), frames=[0])
    told = sidecar(film.sidecar)["scene"]["volume"]["array"]
    assert told == {"shape": [16, 14, 12], "dtype": "float32"}
    assert main.run(["render", str(film.sidecar), "--quiet"]) == 2
    assert "scene.volume.array: unknown key" in (message := capfd.readouterr().err)
    assert "hint: an array in memory, of a film that was made in Python: save it with numpy.save" in message
    np.save("scan.npy", blob())
    assert main.run(["render", str(film.sidecar), "--volume", "scan.npy"]) == 0
    assert capfd.readouterr().err.endswith("film.gif is up to date; --force draws it again\n")


def test_spacing_stretches_an_array() -> None:
    """By twice along x: the same as twice the voxels of a field that is constant along it."""
    array = np.zeros((9, 9, 9), np.uint8)
    array[2:7, 2:7] = 200
    options: dict[str, Any] = {"transfer_function": [(100, "red", 0), (150, "white", 0.5)], "size": (40, 30)}
    stretched = renderer.render_frame(array, 0, spacing=(2, 1, 1), **options)
    np.testing.assert_array_equal(stretched.shape, (30, 40, 3))
    wide = renderer.render_frame(np.repeat(array, 2, axis=2), 0, **options)
    assert np.mean(np.abs(stretched.astype(float) - wide)) < 3


def test_options_take_the_place_of_what_a_scene_says() -> None:
    command("--output", "a.png", "--frames", "1", "--set", "error.tolerance=2", "--set", "output.size=[20, 31]")
    image = renderer.render_frame("scene.yaml", 1, tolerance=2, size=(20, 31))
    assert image._repr_png_() == Path("a.png").read_bytes()
    clear = renderer.render_frame("scene.yaml", 1, background="transparent")
    assert clear.shape == (32, 32, 4) and clear[0, 0, 3] == 0
    scene = renderer.load_scene("scene.yaml")
    assert np.array_equal(renderer.render_frame(scene, 1, camera=scene.camera), renderer.render_frame(scene, 1))
    near = renderer.render_frame(scene, 1, camera={"field_of_view": 60, "distance": 10})
    assert not np.array_equal(near, renderer.render_frame(scene, 1))


def test_a_film_never_takes_the_place_of_a_mapped_array() -> None:
    content = (np.indices((6, 6, 6)).sum(axis=0) * 16).astype(np.uint8).tobytes()
    Path("film.gif").write_bytes(content)
    scene = renderer.suggest_scene(np.memmap("film.gif", np.uint8, "r", 0, (6, 6, 6)))
    with pytest.raises(renderer.InputError, match="would overwrite an input"):
        renderer.render(scene, output="film.gif", frames=range(2))
    assert Path("film.gif").read_bytes() == content


def stop(num_finished: int, num_frames: int) -> None:
    raise ValueError(f"{num_finished} of {num_frames}")


def test_progress_is_told_and_what_it_raises_ends_the_job() -> None:
    """The older film stays until the new one is whole."""
    told: list[tuple[int, int]] = []
    film = renderer.render("scene.yaml", on_progress=lambda *numbers: told.append(numbers))
    assert told == [(1, 3), (2, 3), (3, 3)]
    before = [path.read_bytes() for path in (film.path, film.sidecar)]

    with pytest.raises(ValueError, match="1 of 3"):
        renderer.render("scene.yaml", resume=False, on_progress=stop)
    assert [path.read_bytes() for path in (film.path, film.sidecar)] == before
    assert renderer.render("scene.yaml", on_progress=stop) == film, "it is up to date: nothing is drawn"


def test_a_film_that_was_stopped_shows_the_same_scalars() -> None:
    """The records of frames have what their rays saw. The frames in progress are stored, too: at most two."""
    Path("scene.yaml").write_text(small_scene(frames=6), encoding="utf-8")
    with pytest.raises(ValueError, match="1 of 6"):
        renderer.render("scene.yaml", output="stopped.mp4", on_progress=stop)
    told: list[tuple[int, int]] = []
    resumed = renderer.render("scene.yaml", output="stopped.mp4", on_progress=lambda *numbers: told.append(numbers))
    assert 3 <= len(told) < 6
    whole = renderer.render("scene.yaml")
    assert whole.visibility is not None and len(whole.visibility.ranges) > 1
    assert resumed.visibility == whole.visibility


def test_an_accuracy_that_cannot_be_had() -> None:
    write_scene(error="psnr: 150")
    with pytest.raises(renderer.RenderError, match="beyond full resolution"):
        renderer.render("scene.yaml")
    assert Path("film.mp4").exists()
    film = renderer.render("scene.yaml", best_effort=True)
    told = sidecar(film.sidecar)["schedule"]
    assert not told["met"] and told["requested"] == {"psnr": 150.0} and "beyond full resolution" in told["shortfall"]


def test_another_job_is_writing_the_film() -> None:
    imports = "import renderer\nfrom renderer.film import locked_output\nscene = renderer.load_scene('scene.yaml')"
    with (
        other_process(imports, "locked_output(scene.output, range(3), Path('film.mp4.json'))"),
        pytest.raises(renderer.OutputLockedError, match="another job is writing this output"),
    ):
        renderer.render("scene.yaml")
    assert renderer.render("scene.yaml").path.exists()


def test_the_name_of_a_volume_is_drawn_like_its_array() -> None:
    array = KINDS["uint8"][0][8:40, 8:40, 8:40]
    np.save("scan.npy", array)
    expected = renderer.render_frame(array, size=(32, 32))
    assert np.array_equal(renderer.render_frame("scan.npy", size=(32, 32)), expected)
    Path("one").mkdir()
    Path("scan.npy").rename("one/scan.npy")
    assert np.array_equal(renderer.render_frame(Path("one"), size=(32, 32)), expected)
    film = renderer.render("one/scan.npy", output="{frame}.png", frames=[0])
    assert film.path == Path("{frame}.png")


def test_the_truth_is_what_pictures_come_near_to() -> None:
    scene = renderer.load_scene("scene.yaml")
    truth = renderer.integrate(scene, 1)
    assert (truth.dtype, truth.shape) == (np.float32, (32, 32, 3))
    psnr = [
        -10 * np.log10(np.mean((renderer.render_frame(scene, 1, tolerance=tolerance) / 255 - truth) ** 2))
        for tolerance in (20, 0.1)
    ]
    assert psnr[0] < 40 < psnr[1]
    text = small_scene(frames=NUM_FRAMES, footprint=None).replace("size: [32, 32]", "size: [8, 8]\n  background: white")
    white = parse_scene_content(
        text.encode(), Path("white.yaml"), overrides=(), volume=None, output=None, is_single_frame=False
    )
    assert renderer.integrate(white).max() == 1.0


def test_a_picture_is_an_array_that_notebooks_display() -> None:
    image = renderer.render_frame("scene.yaml")
    assert isinstance(image, np.ndarray)
    assert type(np.asarray(image)) is np.ndarray
    assert image[4:8, ::2]._repr_png_() == encode_png(np.ascontiguousarray(image[4:8, ::2]))
    assert image[..., 0]._repr_png_() is None
    assert (image / 255)._repr_png_() is None


ENDLESS: list[Any] = []
ENDLESS.append(ENDLESS)
RING: dict[str, Any] = {}
RING["ring"] = RING


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: renderer.render_frame(blob(), None), "frame: not the number of a frame\n  got: None"),
        (lambda: renderer.render_frame(blob(), 1.5), "frame: not the number of a frame\n  got: 1.5"),
        (lambda: renderer.integrate("scene.yaml", None), "frame: not the number of a frame\n  got: None"),
        (lambda: renderer.render("scene.yaml", frames=slice(None, None, 0)), "frames: no such frames\n  got: slice"),
        (lambda: renderer.render("scene.yaml", frames=1.0), "frames: no such frames\n  got: 1.0\n  expected: whole"),
        (lambda: renderer.render_frame([[[1, 2], [3]]]), "this cannot be converted to an array"),
        (lambda: renderer.render_frame(ENDLESS), "this cannot be converted to an array"),
        (lambda: renderer.render_frame(object()), "the array: not the axes of a volume\n  got: <object"),
        (lambda: renderer.render_frame(blob(), camera=RING), "an option of more than 50 levels"),
        (lambda: renderer.render_frame(blob(), transfer_function=ENDLESS), "an option of more than 50 levels"),
        (lambda: renderer.render_frame(""), "not the name of a scene file\n  got: ''"),
        (lambda: renderer.load_scene(None), "not the name of a scene file\n  got: None"),
        (
            lambda: renderer.load_scene("scene.yaml", overrides=[5]),
            "overrides: not a list of overrides\n  got: \\[5\\]",
        ),
        (lambda: renderer.load_scene("scene.yaml", overrides="error.tolerance=1"), "overrides: not a list"),
        (lambda: renderer.load_scene("scene.yaml", overrides=None), "overrides: not a list"),
        (lambda: renderer.render_frame(np.ma.masked_greater(blob(), 100)), "a masked array"),
    ],
)
def test_wrong_arguments_are_errors_of_the_input(call: Any, message: str) -> None:
    with pytest.raises(renderer.InputError, match=message):
        call()


def test_an_array_of_which_nothing_is_masked() -> None:
    masked = np.ma.masked_greater(blob(), 1000)
    np.testing.assert_array_equal(renderer.render_frame(masked), renderer.render_frame(blob()))
    hidden = np.ma.masked_greater(blob(), 100).filled(np.nan)
    assert renderer.render_frame(hidden).shape == (512, 512, 3)


@pytest.mark.slow
def test_a_fork_after_opengl_was_used_is_an_error_and_does_not_hang() -> None:
    write_scene("gaussian")
    code = """
import os, renderer
renderer.render_frame("scene.yaml")
child = os.fork()
if child == 0:
    try:
        renderer.render_frame("scene.yaml")
    except renderer.RenderError as error:
        print(error, flush=True)
    os._exit(0)
os.waitpid(child, 0)
"""
    run = subprocess.run(
        [sys.executable, "-W", "ignore::DeprecationWarning", "-c", code],
        env=environment(),
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert (run.returncode, run.stderr) == (0, "")
    assert run.stdout.startswith("OpenGL cannot be used in this process: it was forked from one that had used it")


def test_a_look_may_be_labels_and_takes_their_place() -> None:
    values = np.zeros((12, 12, 12), np.uint8)
    values[3:8, 3:8, 3:8], values[7:10, 7:10, 7:10] = 1, 3
    scene = renderer.suggest_scene(values, labels={"show": [3]}, size=(24, 16))
    look = scene.layers[0].transfer_function
    assert look.labels is not None and look.labels.values == (3,)
    again = renderer.render_frame(values, transfer_function=look, size=(24, 16))
    assert scene.layers[0].shading is not None
    scene = scene.with_layers(shading=None)
    assert again.tobytes() == renderer.render_frame(scene).tobytes()
    points = [(0, "red", 0), (3, "white", 0.5)]
    expected = renderer.render_frame(values, transfer_function=points, size=(24, 16))
    assert renderer.render_frame(scene, transfer_function=points).tobytes() == expected.tobytes()
