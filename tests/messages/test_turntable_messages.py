"""What a user reads when `hsplat init` or `hsplat turntable` cannot do what was asked; and that nothing was written."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from hsplat_cli import main
from tests.support.tiff_files import ome

KNOWN = "NRRD (.nrrd, .nhdr), MetaImage (.mha, .mhd), NIfTI (.nii, .nii.gz), TIFF (.tif), NumPy (.npy) or DICOM"

# Arguments after `turntable -o out`, exit code and the whole text.
REFUSED = {
    "nothing there": (["no/where.npy"], 2, "no/where.npy: no such file or folder\n"),
    "a similar name": (["scam.npy"], 2, "scam.npy: no such file or folder\n  hint: did you mean scan.npy?\n"),
    "an empty glob": (
        ["*.dcm"],
        2,
        "*.dcm: no file matches this pattern\n  hint: it is relative to /scans\n",
    ),
    "a folder without slices": (
        ["empty"],
        2,
        "empty: this folder holds neither a DICOM series nor TIFF slices\n  got: an empty folder\n"
        "  expected: the files of one DICOM series, or .tif files, directly in the folder\n",
    ),
    "slices one by one": (
        ["series/*.dcm"],
        2,
        "series: 2 DICOM files of one folder would be a film each\n"
        "  hint: name the folder: its files are the slices of one volume\n",
    ),
    "text": (
        ["notes.txt"],
        2,
        f"notes.txt: this is not a volume in a known format, or it is damaged\n  expected: {KNOWN}\n"
        "  hint: voxels without a header are read with --shape and --dtype: --shape 512,512,300 --dtype uint16\n",
    ),
    "voxels without a header": (
        ["bare.raw"],
        2,
        f"bare.raw: this is not a volume in a known format, or it is damaged\n  expected: {KNOWN}\n"
        "  hint: voxels without a header are read with --shape and --dtype: --shape 512,512,300 --dtype uint16\n",
    ),
    "a colormap": (
        ["scan.npy", "--colormap", "virids"],
        2,
        "--colormap: unknown colormap\n  got: 'virids'\n"
        "  expected: a name such as viridis, gray, cividis_r or crameri:batlow\n  hint: did you mean viridis?\n",
    ),
    "a background": (
        ["scan.npy", "--background", "blak"],
        2,
        "--background: output.background: not a color\n  got: 'blak'\n"
        '  expected: a color: "#rrggbb", "#rgb", [red, green, blue] from 0 to 1, or a name such as white\n'
        "  hint: did you mean black?\n",
    ),
    "a transparent film": (
        ["scan.npy", "--background", "transparent"],
        2,
        "--background: a transparent background in .mp4\n  expected: a color\n"
        "  hint: only PNG frames can be transparent: --format png\n",
    ),
    "an odd size": (
        ["scan.npy", "--size", "33"],
        2,
        "--size: output.size: odd sizes cannot be encoded as MP4\n  got: [33, 33]\n  expected: even numbers\n"
        "  hint: the nearest is [34, 34]\n",
    ),
    "a scene of that name": (
        ["other/scan.npy"],
        2,
        "out/scan.yaml: another scene of this name exists, perhaps one that was edited\n"
        "  hint: `hsplat render out/scan.yaml` renders it; --force overwrites it\n",
    ),
    "a byte order beside a header": (
        ["scan.npy", "--byte-order", "little"],
        2,
        "--byte-order: this is for a file without a header\n  got: little, without --shape and --dtype\n"
        "  hint: leave it out: a file with a header says it itself; the voxels of others are read with --shape and "
        "--dtype\n",
    ),
    "an offset beside a header": (
        ["scan.npy", "--offset", "0"],
        2,
        "--offset: this is for a file without a header\n  got: 0, without --shape and --dtype\n"
        "  hint: leave it out: a file with a header says it itself; the voxels of others are read with --shape and "
        "--dtype\n",
    ),
    "flat voxels": (
        ["scan.npy", "--spacing", "1,1,1e6"],
        2,
        "scan.npy: the voxels are too long or too flat\n  got: sides with a ratio of 1e+06\n"
        "  expected: a longest side of at most 1e+05 times the shortest\n",
    ),
    "several times": (
        ["times.npy"],
        2,
        "times.npy: the array has four axes\n  got: 2 x 4 x 4 x 4\n"
        "  expected: `--time k` with k from 0 to 1 if the first axis is time, or "
        "`--component k` with k from 0 to 3 if the last axis holds components\n",
    ),
    "no such time": (
        ["times.npy", "--time", "2"],
        2,
        "times.npy: there is no such time step\n  got: --time 2\n  expected: 0 to 1\n",
    ),
    "no such component": (
        ["scan.npy", "--component", "1"],
        2,
        "scan.npy: there is no such component\n  got: --component 1\n"
        "  expected: 0 or no `--component` at all: the volume has one\n",
    ),
    "sizes in units that cannot be compared": (
        ["ome.tif"],
        2,
        "ome.tif: the voxel sizes in this TIFF file are in units that cannot be compared\n"
        "  got: PhysicalSizeX=1 pixel, PhysicalSizeZ=2 \u03bcm\n"
        "  expected: one unit for all, or units of length such as nm, µm and mm\n"
        "  hint: `--spacing X,Y,Z` replaces the spacing in the file\n",
    ),
    "values that are no numbers": (
        ["nan.npy", "--nonfinite", "error"],
        2,
        "nan.npy: 1 of 64 voxels are NaN or infinite\n  got: the first at voxel x, y, z = 0, 0, 0\n"
        "  expected: finite values\n  hint: `--nonfinite lowest` replaces them with the lowest finite value\n",
    ),
    "half a headerless volume": (
        ["scan.npy", "--shape", "2,2,2"],
        2,
        "a headerless file needs both --shape and --dtype\n  got: --shape\n",
    ),
}


@pytest.fixture(autouse=True)
def scans(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder."""
    monkeypatch.chdir(tmp_path)
    for folder in ("empty", "series", "other", "out"):
        Path(folder).mkdir()
    for file in ("series/1.dcm", "series/2.dcm", "out/scan.yaml"):
        Path(file).touch()
    Path("notes.txt").write_text("a text", encoding="utf-8")
    Path("bare.raw").write_bytes(bytes(range(64)))
    sizes = 'SizeX="4" SizeY="4" PhysicalSizeX="1" PhysicalSizeXUnit="pixel" PhysicalSizeZ="2"'
    Path("ome.tif").write_bytes(ome(sizes))
    np.save("scan.npy", np.arange(64).reshape(4, 4, 4))
    np.save("times.npy", np.arange(128).reshape(2, 4, 4, 4))
    np.save("nan.npy", np.array([np.nan, *range(63)]).reshape(4, 4, 4))
    np.save("other/scan.npy", np.arange(64).reshape(4, 4, 4))
    return tmp_path


@pytest.mark.parametrize("case", REFUSED)
def test_refused(case: str, scans: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments, code, text = REFUSED[case]
    assert main.run(["turntable", *arguments, "-o", "out", "--quiet"]) == code
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.replace(str(scans), "/scans") == text
    assert {path.name for path in Path("out").iterdir()} <= {"scan.yaml", "turntable.json"}
    assert Path("out/scan.yaml").read_bytes() == b""


@pytest.mark.parametrize("volume", ["no/where.npy", "*.dcm", "notes.txt", "nan*"])
def test_nothing_is_made_where_nothing_is_done(volume: str) -> None:
    assert main.run(["turntable", volume, "-o", "new/films", "--nonfinite", "error"]) == 2
    assert not Path("new").exists()


def test_no_folder_of_frames_is_made_beside_a_scene_that_was_changed() -> None:
    assert main.run(["turntable", "other/scan.npy", "-o", "out", "--format", "png", "--quiet"]) == 2
    assert {path.name for path in Path("out").iterdir()} == {"scan.yaml", "turntable.json"}


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["x.npy", "--frames", "0"], "Invalid value for '--frames': 0 is not in the range 1<=x<=1000000."),
        (["x.npy", "--size", "1x2x3"], "Invalid value for '--size': '1x2x3' is not a size such as 512 or 640x480, of"),
        (["x.npy", "--elevation", "91"], "Invalid value for '--elevation': 91.0 is not in the range -90<=x<=90."),
        ([], "Missing argument 'VOLUME...'."),
    ],
)
def test_usage(arguments: list[str], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["turntable", "-o", "out", *arguments]) == 2
    assert text in capsys.readouterr().err


def test_a_folder_that_is_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["turntable", "scan.npy", "-o", "notes.txt/films"]) == 2
    assert capsys.readouterr().err == ("notes.txt/films/scan.yaml: the output folder is a file\n  got: notes.txt\n")


@pytest.mark.parametrize("command", ["init", "info"])
def test_voxels_without_a_header(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run([command, "bare.raw"]) == 2
    assert capsys.readouterr().err == REFUSED["voxels without a header"][2]


def test_init_over_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    Path("old.yaml").touch()
    assert main.run(["init", "scan.npy", "--output", "old.yaml"]) == 2
    assert capsys.readouterr().err == (
        "old.yaml: this file exists\n  hint: --force overwrites it; --output names another one\n"
    )


@pytest.mark.parametrize("name", ["film.mp4", "scene", "scene.json"])
def test_init_writes_scenes_only(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["init", "scan.npy", "--output", name]) == 2
    assert capsys.readouterr().err == (
        f"{name}: the output of init is a scene\n  expected: the name of a .yaml or .yml file\n"
        f"  hint: --output {Path(name).stem}.yaml; the film gets its name in it\n"
    )
    assert not Path(name).exists()


@pytest.mark.parametrize("volume", ["scan.npy", "no/where.npy"])
def test_init_into_a_folder_that_is_not_there(volume: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Which is said first, before the volume is read."""
    assert main.run(["init", volume, "--output", "no/such/scene.yaml"]) == 2
    assert capsys.readouterr().err == (
        "no/such/scene.yaml: the folder of the output does not exist\n  got: no/such\n  hint: make it first\n"
    )
    assert not Path("no").exists()


@pytest.mark.parametrize("arguments", [["init", "--output"], ["turntable", "-o"]])
def test_a_name_that_is_too_long(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    command, option = arguments
    assert main.run([command, "scan.npy", option, "x" * 300 + ".yaml"]) == 1
    assert capsys.readouterr().err.endswith(": the output cannot be written\n  got: File name too long\n")


def test_init_into_a_folder_that_is_a_file(capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["init", "no/where.npy", "--output", "notes.txt/scene.yaml"]) == 2
    assert capsys.readouterr().err == "notes.txt/scene.yaml: the output folder is a file\n  got: notes.txt\n"


@pytest.mark.parametrize("arguments", [["init"], ["init", "--output", "a.yaml"], ["turntable", "-o", "films"]])
def test_voxels_that_no_scene_can_draw(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    """They are refused at once, as `render` would, and no scene is written."""
    command, *options = arguments
    header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nspacings: 1e-6 1e-3 1\nencoding: raw\n\n"
    Path("flat.nrrd").write_bytes(header.encode() + bytes(range(8)))
    assert main.run([command, "flat.nrrd", *options]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err == (
        "flat.nrrd: the voxels are too long or too flat\n"
        "  got: sides with a ratio of 1e+06\n"
        "  expected: a longest side of at most 1e+05 times the shortest\n"
    )
    assert not Path("a.yaml").exists() and not Path("films/flat.yaml").exists()


def signed_with_a_hole() -> None:
    """Waves about 0, and NaN in a corner, as holes.npy."""
    z, y, x = np.meshgrid(*[np.linspace(0, 9, 24)] * 3, indexing="ij")
    values = (np.sin(z) + np.cos(y) * np.sin(x)).astype(np.float32)
    values -= values.mean()
    values[:6] = np.nan
    values[12, 3, 4] = -np.inf
    np.save("holes.npy", values)


def test_what_becomes_of_nan_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    signed_with_a_hole()
    assert main.run(["init", "holes.npy"]) == 0
    said = capsys.readouterr()
    fate = "3457 of 13824 voxels are NaN or infinite; they are drawn as 0, which is not seen"
    assert said.err.splitlines()[1] == f"holes.npy: {fate}"
    assert f"\n  # {fate}.\n  nonfinite: 0 " in said.out
    for given, told in (("lowest", "the lowest value, -"), ("-0.25", "-0.25, which is ")):
        assert main.run(["init", "holes.npy", f"--nonfinite={given}"]) == 0
        said = capsys.readouterr()
        assert f"3457 of 13824 voxels are NaN or infinite; they are drawn as {told}" in said.err
        assert f"\n  nonfinite: {given} " in said.out


def test_nan_that_show_are_said_to_show(capsys: pytest.CaptureFixture[str]) -> None:
    signed_with_a_hole()
    assert main.run(["init", "holes.npy", "--nonfinite", "lowest"]) == 0
    assert capsys.readouterr().err.rstrip().endswith(", which can be seen")


def test_turntable_tells_of_nan(capsys: pytest.CaptureFixture[str]) -> None:
    signed_with_a_hole()
    assert main.run(["turntable", "holes.npy", "-o", "films", "--frames", "1", "--size", "16"]) == 0
    assert "holes.npy: 3457 of 13824 voxels are NaN or infinite; they are drawn as 0, " in capsys.readouterr().err
    assert "\n  nonfinite: 0 " in Path("films/holes.yaml").read_text(encoding="utf-8")


def test_a_fill_value_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    z, y, x = np.meshgrid(*[np.linspace(-1, 1, 24)] * 3, indexing="ij")
    values = np.exp(-4 * (x**2 + y**2 + z**2)).astype(np.float32)
    values[:6] = 1e20
    values[12, 3, 4] = -50
    np.save("filled.npy", values)
    told = [
        "1 of 13824 voxels is -50, far from all others: taken for an outlier, and transparent",
        "3456 of 13824 voxels are 1e+20, far from all others: taken for a fill value, and transparent",
    ]
    assert main.run(["init", "filled.npy"]) == 0
    said = capsys.readouterr()
    assert said.err.splitlines()[1:] == [f"filled.npy: {line}" for line in told]
    assert "".join(f"# {line}.\n" for line in told) in said.out
    assert main.run(["info", "filled.npy"]) == 0
    assert "".join(f"               {line}\n" for line in told) in capsys.readouterr().out
    assert main.run(["turntable", "filled.npy", "-o", "films", "--frames", "1", "--size", "16"]) == 0
    assert f"filled.npy: {told[1]}\n" in capsys.readouterr().err


@pytest.mark.parametrize("given", ["nan", "lowst", "1e999"])
def test_nan_cannot_become_anything(given: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["init", "scan.npy", "--nonfinite", given]) == 2
    assert f"'{given}' is neither error nor lowest nor a finite number." in capsys.readouterr().err


def test_volumes_of_numbers_need_no_word_about_nan(capsys: pytest.CaptureFixture[str]) -> None:
    np.save("whole.npy", np.arange(64.0).reshape(4, 4, 4))
    assert main.run(["init", "whole.npy"]) == 0
    said = capsys.readouterr()
    assert "NaN or" not in said.err + said.out and "\n  nonfinite: lowest " in said.out


def test_what_was_chosen_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["init", "scan.npy"]) == 0
    said = capsys.readouterr()
    assert said.err == "scan.npy: filled volume; there is no background; the upper 40% of the values are shown\n"
    assert said.out.startswith(
        "# A turntable of scan.npy: filled volume;\n# there is no background; the upper 40% of the values are shown.\n"
    )
