"""`hsplat check` says what `hsplat render` would, and leaves nothing behind."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from hsplat_cli import main

KNOWN = "NRRD (.nrrd, .nhdr), MetaImage (.mha, .mhd), NIfTI (.nii, .nii.gz), TIFF (.tif), NumPy (.npy) or DICOM"
NO_VOLUME = f"""\
  expected: {KNOWN}
  hint: voxels without a header are read with `raw: {{file, shape, dtype, spacing}}`
"""
FRAMES = "  expected: A:B or A:B:STEP or one number; this path has the frames 0 to 119\n"

# Arguments after the scene, exit code and the whole text.
REFUSED = {
    "no such frame": (["--frames", "200"], 2, f"--frames: no frame is in this range\n  got: '200'\n{FRAMES}"),
    "no range of frames": (["--frames", "a:b"], 2, f"--frames: not a range of frames\n  got: 'a:b'\n{FRAMES}"),
    "an unknown output": (
        ["--output", "film.avi"],
        2,
        "--output film.avi: output.file: unknown output format\n  got: 'film.avi'\n"
        "  expected: a .mp4 or .gif, frames such as frames/{frame:04}.png or, for one frame (--frames 7), still.png\n",
    ),
    "a folder that is a file": (
        ["--output", "/scans/walnut.raw/deeper/film.mp4"],
        2,
        "/scans/walnut.raw/deeper/film.mp4: the output folder is a file\n  got: /scans/walnut.raw\n",
    ),
    "an output that is a folder": (
        ["--output", "/scans/folder.mp4"],
        2,
        "/scans/folder.mp4: the output is a folder\n  expected: the name of a file\n",
    ),
    "a first frame that is a folder": (
        ["--output", "/scans/{frame:03}.png", "--frames", "7:9"],
        2,
        "/scans/007.png: the output is a folder\n  expected: the name of a file\n",
    ),
    "a folder that is a link to nothing": (
        ["--output", "/scans/link/deeper/film.mp4"],
        2,
        "/scans/link/deeper/film.mp4: the output folder is a broken link\n  got: /scans/link\n",
    ),
    "a folder that is a link to itself": (
        ["--output", "/scans/circle/film.mp4"],
        2,
        "/scans/circle/film.mp4: the output folder is a broken link\n  got: /scans/circle\n",
    ),
    "where there are no files": (
        ["--output", "/proc/film.mp4"],
        1,
        "/proc/film.mp4: files cannot be created here\n  hint: choose another folder for the output\n",
    ),
    "where there are no folders": (
        ["--output", "/proc/new/film.mp4"],
        1,
        "/proc/new/film.mp4: files cannot be created here\n  hint: choose another folder for the output\n",
    ),
    "a name that frames need": (
        ["--output", "/scans/taken.mp4"],
        2,
        "/scans/taken.mp4.unfinished: something else has the name of the folder for unfinished frames\n"
        "  got: a file\n  hint: rename it, or choose another --output\n",
    ),
    "a sidecar that is a folder": (
        ["--output", "/scans/film.gif"],
        2,
        "/scans/film.gif.json: the output is a folder\n  expected: the name of a file\n",
    ),
    "a name that is too long": (
        ["--output", f"/scans/new/{250 * 'a'}.mp4"],
        1,
        f"/scans/new/{250 * 'a'}.mp4: the output cannot be written\n  got: File name too long\n",
    ),
    "a path that is too long": (
        ["--output", f"/scans/{5000 * 'a/'}film.mp4"],
        1,
        f"/scans/{5000 * 'a/'}film.mp4: the output cannot be written\n  got: File name too long\n",
    ),
    "text for a volume": (
        ["--volume", "/scans/scene.yaml"],
        2,
        f"/scans/scene.yaml: this is not a volume in a known format, or it is damaged\n{NO_VOLUME}",
    ),
    "an empty volume": (
        ["--volume", "/scans/empty.vtk"],
        2,
        "/scans/empty.vtk: this is not a volume in a known format, or it is damaged\n"
        f"  got: an empty file\n{NO_VOLUME}",
    ),
    "a folder without slices": (
        ["--volume", "/scans/slices"],
        2,
        "/scans/slices: this folder holds neither a DICOM series nor TIFF slices\n  got: an empty folder\n"
        "  expected: the files of one DICOM series, or .tif files, directly in the folder\n",
    ),
    "a folder of something else": (
        ["--volume", "/scans/notes"],
        2,
        "/scans/notes: this folder holds neither a DICOM series nor TIFF slices\n"
        "  expected: the files of one DICOM series, or .tif files, directly in the folder\n",
    ),
    "out of proportion": (
        ["--set", "camera.near=1e20"],
        2,
        "--set camera.near=1e20: camera.near: too far from the eye for this volume\n  got: 1e+20\n"
        "  expected: at most 4.8e+13, 1e+12 times half the volume's diagonal\n",
    ),
}  # fmt: skip


def said(capsys: pytest.CaptureFixture[str], folder: Path, arguments: list[str]) -> tuple[int, str]:
    """Exit code and errors of a command that says nothing else, with /scans for the folder."""
    code = main.run([argument.replace("/scans", str(folder)) for argument in arguments])
    out, err = capsys.readouterr()
    assert out == ""
    return code, err.replace(str(folder), "/scans")


@pytest.mark.parametrize("name", REFUSED)
def test_check_and_render_refuse_alike(name: str, scene_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments, code, text = REFUSED[name]
    for folder in ("folder.mp4", "007.png", "slices", "film.gif.json"):
        (scene_folder / folder).mkdir()
    (scene_folder / "notes" / "more").mkdir(parents=True)
    (scene_folder / "notes" / "readme").write_text("no volume here")
    for file in ("empty.vtk", "taken.mp4.unfinished"):
        (scene_folder / file).touch()
    (scene_folder / "link").symlink_to("nowhere")
    (scene_folder / "circle").symlink_to("circle")
    before = sorted(scene_folder.rglob("*"))
    assert said(capsys, scene_folder, ["check", "scene.yaml", *arguments]) == (code, text)
    assert sorted(scene_folder.rglob("*")) == before
    assert said(capsys, scene_folder, ["render", "scene.yaml", "--quiet", *arguments]) == (code, text)


@pytest.mark.usefixtures("scene_folder")
def test_a_folder_that_may_not_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The superuser, as whom tests may run, may write everywhere: the answer of the system is replaced."""
    monkeypatch.setattr(os, "access", lambda path, mode: mode == os.R_OK)
    assert said(capsys, tmp_path, ["check", "scene.yaml", "--output", "/scans/new/film.mp4"]) == (
        1,
        "/scans/new/film.mp4: no permission to write here\n  hint: choose another folder for the output\n",
    )


def test_a_volume_that_may_not_be_read(
    scene_folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(os, "access", lambda path, mode: Path(path).name != "scan.nrrd")
    source = ["--set", "volume.procedural=null", "--set", "volume.file=/scans/scan.nrrd"]
    assert said(capsys, scene_folder, ["check", "scene.yaml", *source]) == (
        2,
        "/scans/scan.nrrd: no permission to read this\n",
    )


def test_what_is_right_leaves_nothing_behind(scene_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = sorted(scene_folder.rglob("*"))
    assert main.run(["check", "scene.yaml", "--frames", "::10", "--output", "new/deeper/{frame}.png"]) == 0
    assert capsys.readouterr().out == (
        "scene.yaml: ok\n"
        "  volume   engine_block, 64 x 64 x 32\n"
        "  camera   turntable, 12 of 120 frames\n"
        "  error    optical, tolerance 0.1\n"
        "  output   new/deeper/{frame}.png, 512 x 512\n"
    )
    assert sorted(scene_folder.rglob("*")) == before


@pytest.mark.parametrize("key", ["error.tolerance", "camera.path.frames", "output.size", "splat.footprint"])
def test_a_key_without_its_section(key: str, scene_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["check", "scene.yaml", "--set", f"{key.rpartition('.')[2]}=1"]) == 2
    assert f"\n  hint: did you mean {key}?\n" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("schedule", "told"),
    [
        ("{tolerance: {0: 2, 12: 0.02, 23: 2}}", "tolerance 2 to 0.02 to 2"),
        ("{tolerance: {0: 2, 5: 1, 12: 0.02, 23: 0.02}}", "tolerance 2 to 0.02"),
        ("{tolerance: {0: 2, 12: 2}}", "tolerance 2"),
        ("{tolerance: {0: 2, 5: 1, 12: 3, 13: 1, 23: 2}}", "tolerance 1 to 3"),
        ("{splats: {0: 9, 5: 1, 12: 9}}", "at most 9 to 1 to 9 bricks"),
    ],
)
def test_a_schedule_is_told_with_its_turns(
    schedule: str, told: str, scene_folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main.run(["check", "scene.yaml", "--set", f"error={schedule}"]) == 0
    assert f", {told}\n" in capsys.readouterr().out


@pytest.mark.usefixtures("scene_folder")
def test_what_takes_the_place_of_a_file_s_spacing_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    np.save("scan.npy", np.zeros((2, 2, 2), np.uint8))
    spacing = ["--set", "volume={file: scan.npy, spacing: [0.1, 0.1, 0.5]}"]
    assert main.run(["check", "scene.yaml", *spacing]) == 0
    volume = f"{Path.cwd() / 'scan.npy'}, spacing 0.1 x 0.1 x 0.5 in place of its own"
    assert capsys.readouterr().out.splitlines()[1] == f"  volume   {volume}"


# The first bytes of a volume, by the name of the file: none of these must be refused at a glance.
VOLUMES = {
    "a.nrrd": b"NRRD0004\ntype: uchar\n",
    "a.nhdr": b"NRRD0005\ntype: uchar\n",
    "a.mha": b"ObjectType = Image\nNDims = 3\n",
    "a.npy": b"\x93NUMPY\x01\x00",
    "a.tif": b"II*\0\x08\0\0\0",
    "a.TIFF": b"MM\0*\0\0\0\x08",
    "a.nii": b"\x5c\x01\0\0",
    "a.nii.gz": b"\x1f\x8b\x08\x08abc",
    "a.img": b"\0\0\0\0",
    "IM000001": bytes(128) + b"DICM",
    "a.vtk": b"# vtk DataFile Version 3.0\n",
}


@pytest.mark.parametrize("name", VOLUMES)
def test_what_may_be_a_volume_is_not_refused(name: str, scene_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (scene_folder / name).write_bytes(VOLUMES[name])
    assert main.run(["check", "scene.yaml", "--volume", name]) == 0, capsys.readouterr().err
