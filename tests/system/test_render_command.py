"""`hsplat render` from the scene file to the last byte of what it writes."""

from __future__ import annotations

import math
import platform
from itertools import pairwise
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import numpy as np
import pytest
from small_scene import sidecar, small_scene

from hsplat_cli import main
from renderer.volume import Array

pytestmark = pytest.mark.usefixtures("scene_folder")

NO_TOLERANCE = ("--set", "error.tolerance=null")

SCENE = small_scene(frames=6, size="48, 32", error="tolerance: 0.1")


def render(*arguments: str) -> None:
    assert main.run(["render", "scene.yaml", *arguments]) == 0


def shown(name: str) -> Array:
    """Every frame of a film, uint8 [frame, h, w, 3]."""
    return np.asarray(imageio.imread(name, index=None))


def test_a_film_says_how_exact_it_is(scheduler: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The figures are the same on every run, and no byte of the film depends on the rays."""
    render()
    film, made = Path("film.mp4").read_bytes(), sidecar()
    accuracy, frames = made["accuracy"], [frame["accuracy"] for frame in made["frames"]]
    low, high = accuracy["interval"]
    assert low < accuracy["psnr"] < high
    assert f"frames PSNR {accuracy['psnr']:.1f} dB ({low:.1f} to {high:.1f})" in capsys.readouterr().out
    assert accuracy["rays"] == sum(frame["rays"] for frame in frames)
    assert accuracy["psnr"] == pytest.approx(-10 * math.log10(np.mean([f["mean"] for f in frames])))
    worst = min(range(6), key=lambda number: frames[number]["psnr"])
    assert accuracy["worst"] == {"frame": worst} | {key: frames[worst][key] for key in ("psnr", "interval")}
    render("--force", "--scheduler", scheduler)
    assert (Path("film.mp4").read_bytes(), sidecar()["accuracy"]) == (film, accuracy)
    assert sidecar()["visibility"] == made["visibility"]
    capsys.readouterr()
    render("--force", "--set", "error.probes=0")
    assert Path("film.mp4").read_bytes() == film
    assert not {"accuracy", "visibility"} & sidecar().keys()
    assert "exact picture" not in capsys.readouterr().out
    render()  # the film is up to date, whether its accuracy is known or not
    assert "accuracy" not in sidecar()


def test_a_film_says_which_scalars_it_shows(capsys: pytest.CaptureFixture[str]) -> None:
    """What is hidden is told, after the line about the film; without that, nothing is."""
    render()
    found, frames = sidecar()["visibility"], sidecar()["frames"]
    assert sum(each["share"] for each in found["ranges"]) == pytest.approx(1.0, abs=1e-5)
    shown = np.mean([frame["visible"] for frame in frames], axis=0)
    np.testing.assert_allclose([each["share"] * found["coverage"] for each in found["ranges"]], shown, atol=1e-5)
    assert "hardly seen" not in capsys.readouterr().out
    points = "[{value: 50, color: black, opacity: 0}, {value: 90, color: white, opacity: 0.999999}"
    hidden = ", {value: 200, color: white, opacity: 0.99}, {value: 255, color: white, opacity: 0.99}]"
    render("--set", f"transfer_function.points={points}{hidden}")
    assert "hardly seen: values from 200 to 255, " in capsys.readouterr().out


def test_parts_are_as_exact_as_the_film() -> None:
    for name, frames in (("all", ":"), ("parts", ":3"), ("parts", "3:")):
        render("--output", f"{name}/{{frame}}.png", "--frames", frames)
    assert main.run(["assemble", "parts", "--output", "joined.mp4"]) == 0
    joined = sidecar("joined.mp4.json")["accuracy"]
    kept = joined.pop("file")
    assert joined == sidecar("all/frames.json")["accuracy"]
    assert sidecar("joined.mp4.json")["visibility"] == sidecar("all/frames.json")["visibility"]
    assert 25 < kept["psnr"] < kept["psnr_of_encoding"] < joined["psnr"]
    assert kept["frames"] == 6


def test_alpha_is_straight() -> None:
    """Over the background it is the picture that has that background, but for two roundings and that of the sum."""
    render("--output", "clear-{frame}.png", "--frames", "0", "--set", "output.background=transparent")
    render("--output", "grey-{frame}.png", "--frames", "0", "--set", "output.background=[0.4, 0.4, 0.4]")
    clear = imageio.imread("clear-0.png").astype(float)
    assert clear.shape == (32, 48, 4)
    alpha = clear[..., 3:] / 255
    assert 0 < alpha.mean() < alpha.max()
    over = clear[..., :3] * alpha + (1 - alpha) * 0.4 * 255
    np.testing.assert_allclose(over, imageio.imread("grey-0.png"), atol=0.5 + 0.5 + 1)


def test_the_sidecar_says_how_it_was_made() -> None:
    render("--set", "error.tolerance={0: 0.8, 3: 0.1}")
    made = sidecar("film.mp4.json")
    assert list(made) == [
        "format", "scene", "volume", "camera", "pyramid", "device", "versions", "schedule", "notes", "seconds",
        "accuracy", "visibility", "memory", "fingerprint", "digest", "frames",
    ]  # fmt: skip
    assert made["scene"]["splat"] == {"footprint": "integrated"}
    assert made["volume"]["shape"] == [24, 24, 12]
    assert made["volume"]["dtype"] == "uint8"
    assert made["volume"]["world_from_index"] == np.eye(4).tolist()
    assert len(made["volume"]["fingerprint"]) == 32
    assert made["camera"]["target"] == [11.5, 11.5, 5.5]
    assert made["camera"]["distance"] > 20
    assert made["device"] == "the processor"
    assert made["versions"]["python"] == platform.python_version()
    assert made["versions"]["numpy"] == np.__version__
    assert made["notes"] == []
    assert [frame["frame"] for frame in made["frames"]] == [0, 1, 2, 3, 4, 5]
    for frame in made["frames"]:
        assert 0 < frame["primitives"] <= frame["cells"]
        assert {"order", "draw", "quantize", "encode"} <= set(frame["seconds"])
    assert all(seconds >= 0 for part in (made, *made["frames"]) for seconds in part["seconds"].values()), (
        "a stage took less than no time"
    )


def test_the_schedule_changes_the_cut_only_when_the_tolerance_changes() -> None:
    render("--set", "error.tolerance={1: 10, 3: 0.01}", "--set", "volume.procedural.shape=[48, 40, 24]")
    frames = sidecar("film.mp4.json")["frames"]
    tolerances = [frame["tolerance"] for frame in frames]
    assert tolerances == [10, 10, pytest.approx(0.1**0.5), 0.01, 0.01, 0.01]
    assert ["cut" in frame["seconds"] for frame in frames] == [True, False, True, True, False, False]
    assert [frame["cells"] for frame in frames] == [11, 11, 18, 18, 18, 18]
    rays = [frame["rays"] for frame in frames]
    assert rays[0] < 1 < rays[2] < rays[-1]


def test_nothing_visible_is_a_film_of_the_background(capsys: pytest.CaptureFixture[str]) -> None:
    """The camera then frames the whole volume; that the film is empty is told."""
    note = "nothing is visible: the transfer function hides every voxel; `hsplat info` shows which values there are"
    changes = ["transfer_function.points.0.value=300", "transfer_function.points.1.value=400"]
    changes += ["transfer_function.points.2.value=500", "output.background=[1, 0.5, 0]", "camera.target=visible"]
    render("--output", "{frame}.png", "--frames", "2", *(word for change in changes for word in ("--set", change)))
    picture = imageio.imread("2.png")
    assert (picture == [255, 128, 0]).all()
    made = sidecar("frames.2.json")
    assert made["notes"] == [note]
    assert made["frames"][0]["primitives"] == 0
    assert math.isfinite(made["camera"]["distance"])
    assert f"note: {note}\n" in capsys.readouterr().out


# Bricks, by every schedule


LARGE = ("--set", "volume.procedural.shape=[48, 40, 24]", "--set", "camera.path.frames=4")


def render_large(*options: str) -> dict[str, Any]:
    """Return the sidecar of a film of several bricks."""
    render(*LARGE, "--quiet", *options)
    return sidecar("film.mp4.json")


def column(made: dict[str, Any], key: str) -> list[Any]:
    return [frame[key] for frame in made["frames"]]


def test_a_budget_of_bricks() -> None:
    """The last frame may have all that there are."""
    made = render_large(*NO_TOLERANCE, "--set", "error.splats={0: 1, 3: 100}")
    cells, tolerances = column(made, "cells"), column(made, "tolerance")
    assert cells[0] == 1 and cells[-1] == 18 and tolerances[-1] == 0
    assert all(a <= b for a, b in pairwise(cells)) and all(a >= b for a, b in pairwise(tolerances))


def test_a_budget_of_time() -> None:
    """So much that the finest detail fits."""
    made = render_large(*NO_TOLERANCE, "--set", "error.seconds=20")
    assert column(made, "tolerance") == [0] * 4
    assert all(0 < seconds < 20 for seconds in column(made, "predicted_seconds"))
    assert made["schedule"]["met"] and not made["schedule"]["reproducible"]


@pytest.mark.parametrize(
    "settings", ["pyramid={average: opacity, precision: single}", "error={measure: rms, of: scalar, tolerance: 2}"]
)
def test_means_and_errors_of_any_kind(settings: str) -> None:
    made = render_large("--set", settings, "--set", "shading={ambient: 0.4}", "--set", "annotation.octree=true")
    assert column(made, "cells")[0] > 1
