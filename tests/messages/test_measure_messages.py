"""What a user reads when `hsplat measure` cannot do what was asked, and nothing is left lying."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

from hsplat_cli import main

SMALL = ["--set", "camera.path.frames=6", "--set", "output.size=[32, 32]", "--set", "volume.procedural.shape=[8, 8, 8]"]
ELSEWHERE = ["--set", "camera.target=[10000, 0, 0]"]


@pytest.fixture
def measure(scene_folder: Path, capsys: pytest.CaptureFixture[str]):  # type: ignore[no-untyped-def]
    """Runs `hsplat measure` on a small scene: exit code and what was said; no file may have come or changed."""

    def files() -> dict[Path, bytes]:
        return {path: path.read_bytes() for path in scene_folder.rglob("*") if path.is_file()}

    def run(*arguments: str) -> tuple[int, str]:
        before = files()
        code = main.run(["measure", "scene.yaml", *SMALL, "--quiet", *arguments])
        said = capsys.readouterr()
        assert said.out == ""
        assert files() == before
        return code, said.err.replace(str(scene_folder), "/scans")

    return run


LIST = "several with commas between them"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ("--tolerances", "0.1,fine"),
            f"--tolerances: cannot be swept\n  got: 'fine'\n  expected: 0.5, 0.1 or 0, {LIST}\n",
        ),
        (
            ("--tolerances", "-1"),
            f"--tolerances: cannot be swept\n  got: '-1'\n  expected: 0.5, 0.1 or 0, {LIST}\n",
        ),
        (
            ("--tolerances", "0.1,,1"),
            f"--tolerances: cannot be swept\n  got: ''\n  expected: 0.5, 0.1 or 0, {LIST}\n",
        ),
        (
            ("--footprints", "gausian"),
            "--footprints: cannot be swept\n  got: 'gausian'\n"
            f"  expected: gaussian, gouraud, gouraud:12x4 or integrated, {LIST}\n"
            "  hint: did you mean gaussian?\n",
        ),
        (
            ("--footprints", "gouraud:2x1"),
            "--footprints: cannot be swept\n  got: 'gouraud:2x1'\n"
            f"  expected: gaussian, gouraud, gouraud:12x4 or integrated, {LIST}\n"
            "  hint: did you mean gouraud:12x4?\n",
        ),
        (
            ("--measures", "rms:scaler"),
            f"--measures: cannot be swept\n  got: 'rms:scaler'\n  expected: optical, rms or rms:scalar, {LIST}\n"
            "  hint: did you mean rms:scalar?\n",
        ),
        (
            ("--corrections", "yes"),
            f"--corrections: cannot be swept\n  got: 'yes'\n  expected: on or off, {LIST}\n",
        ),
        (
            ("--want", "sharp"),
            "--want: not an accuracy that can be wanted\n  got: 'sharp'\n"
            "  expected: psnr=38, rmse=0.01, ssim=0.95, flip=0.02 or other values\n",
        ),
        (
            ("--want", "psnr=nan"),
            "--want: not an accuracy that can be wanted\n  got: 'psnr=nan'\n"
            "  expected: psnr=38, rmse=0.01, ssim=0.95, flip=0.02 or other values\n",
        ),
        (
            ("--want", "ssim=95"),
            "--want: out of the range of ssim\n  got: 'ssim=95'\n  expected: more than 0 and at most 1\n",
        ),
        (
            ("--want", "psnr=20", "--tolerances", "0.1"),
            "hsplat measure: has no use beside --want: --tolerances\n"
            "  hint: --want searches with the scene's own footprint and error measure; change those with --set\n",
        ),
        (
            ("--truth-tolerance", "0"),
            "--truth-tolerance: out of range\n  got: 0\n  expected: more than 0 and less than 1\n",
        ),
        (
            ("--frames", "6"),
            "--frames: no frame is in this range\n  got: '6'\n"
            "  expected: A:B or A:B:STEP or one number; this path has the frames 0 to 5\n",
        ),
    ],
)
def test_options(measure, arguments: tuple[str, ...], message: str) -> None:  # type: ignore[no-untyped-def]
    assert measure(*arguments) == (2, message)


@pytest.mark.parametrize("want", [(), ("--want", "psnr=30")])
def test_a_scene_that_draws_nothing(measure, want: tuple[str, ...]) -> None:  # type: ignore[no-untyped-def]
    num = 6 if want else 3
    assert measure(*ELSEWHERE, *want) == (
        2,
        "the scene draws nothing, so there is nothing to measure\n"
        f"  got: {num} frames without anything of the volume\n"
        "  expected: a volume in view, and a transfer function that shows some of it\n"
        "  hint: `hsplat info` shows which values there are\n",
    )


def test_a_picture_too_small_for_ssim(measure) -> None:  # type: ignore[no-untyped-def]
    assert measure("--want", "ssim=0.9", "--set", "output.size=[32, 10]") == (
        2,
        "output.size: the picture is too small for SSIM\n  got: 32 x 10\n  expected: at least 11 pixels each way\n"
        "  hint: want a psnr, rmse or flip\n",
    )


def test_an_accuracy_beyond_full_resolution(measure) -> None:  # type: ignore[no-untyped-def]
    code, said = measure("--want", "psnr=200")
    assert code == 1
    lines = said.splitlines()
    assert lines[0] == "--want psnr=200: the requested accuracy is beyond full resolution"
    assert (
        lines[1].startswith("  got: psnr ")
        and "dB on frame " in lines[1]
        and lines[1].endswith(" brick at tolerance 0")
    )
    hint = "  hint: want less; docs/footprints.md says what limits it"
    assert lines[2:] == ["  expected: psnr 200.00 dB", hint]


def test_a_truth_that_does_not_converge(measure) -> None:  # type: ignore[no-untyped-def]
    code, said = measure("--truth-tolerance", "1e-300", "--set", "shading={ambient: 0.3, diffuse: 0.7}")
    assert code == 1
    assert said.startswith(
        "procedural engine_block: the ray integral does not converge in 12 halvings of its step\n  got: "
    )
    assert "\n  expected: a change below 1e-300 at two halvings in a row\n  hint: " in said


@pytest.mark.parametrize("place", ["taken", "taken/inside"])
def test_a_folder_that_cannot_be(measure, scene_folder: Path, place: str) -> None:  # type: ignore[no-untyped-def]
    (scene_folder / "taken").write_text("a file")
    code, said = measure("--output", place)
    assert code == 2
    assert said.splitlines()[0].startswith(place)


def test_vtk_missing(measure, monkeypatch: pytest.MonkeyPatch) -> None:  # type: ignore[no-untyped-def]
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *rest: None if name.startswith("vtk") else find_spec(name, *rest)
    )
    assert measure("--peer", "vtk") == (
        2,
        "the package vtk is not installed\n  hint: pip install 'hsplat[vtk]'\n",
    )


def test_vtk_has_another_light(measure) -> None:  # type: ignore[no-untyped-def]
    assert measure("--peer", "vtk", "--set", "shading={ambient: 0.3, diffuse: 0.7}") == (
        2,
        "shading: VTK cannot be compared on a scene with shading: its lighting model differs\n"
        "  hint: measure without the peer, or without shading\n",
    )
