"""Messages of `hsplat turntable` and `hsplat init` where they refuse, replace or leave out something."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dicom_files import image_fields, save
from tiff_files import ome
from transcripts import Case, cases

from hsplat_cli import main


@pytest.fixture(autouse=True)
def folder(folder: Path) -> None:
    """Fill the current folder with files, most of them with one fault."""
    for name in ("empty", "series", "other", "out"):
        Path(name).mkdir()
    for k in range(2):
        save(Path(f"series/{k}.dcm"), image_fields(np.zeros((4, 5), np.uint8), InstanceNumber=str(k)))
    Path("out/scan.yaml").touch()
    Path("notes.txt").write_text("a text", encoding="utf-8")
    Path("bare.raw").write_bytes(bytes(range(64)))
    sizes = 'SizeX="4" SizeY="4" PhysicalSizeX="1" PhysicalSizeXUnit="pixel" PhysicalSizeZ="2"'
    Path("ome.tif").write_bytes(ome(sizes))
    header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nspacings: 1e-6 1e-3 1\nencoding: raw\n\n"
    Path("flat.nrrd").write_bytes(header.encode() + bytes(range(8)))
    np.save("scan.npy", np.arange(64).reshape(4, 4, 4))
    np.save("times.npy", np.arange(128).reshape(2, 4, 4, 4))
    np.save("nan.npy", np.array([np.nan, *range(63)]).reshape(4, 4, 4))
    np.save("whole.npy", np.arange(64.0).reshape(4, 4, 4))
    np.save("other/scan.npy", np.arange(64).reshape(4, 4, 4))
    np.save("other/two.npy", np.arange(64).reshape(4, 4, 4))
    Path("other/notes.txt").touch()
    z, y, x = np.meshgrid(*[np.linspace(-1, 1, 24)] * 3, indexing="ij")
    np.save("labels.npy", np.select([x < -0.15, x > 0.15], [3, 90], 17) * (x**2 + y**2 + z**2 < 0.7))
    np.save("same.npy", np.full((4, 4, 4), 7, np.uint8))
    header = "NRRD0004\ntype: float\ndimension: 3\nsizes: 4 4 4\nendian: little\nencoding: raw\n\n"
    Path("nan.nrrd").write_bytes(header.encode() + np.array([np.nan, *range(63)], "<f4").tobytes())
    np.save("holes.npy", signed_waves_with_a_hole())
    np.save("filled.npy", blob_with_fill_values())


def signed_waves_with_a_hole() -> np.ndarray:
    z, y, x = np.meshgrid(*[np.linspace(0, 9, 24)] * 3, indexing="ij")
    values = (np.sin(z) + np.cos(y) * np.sin(x)).astype(np.float32)
    values -= values.mean()
    values[:6] = np.nan
    values[12, 3, 4] = -np.inf
    return values


def blob_with_fill_values() -> np.ndarray:
    z, y, x = np.meshgrid(*[np.linspace(-1, 1, 24)] * 3, indexing="ij")
    values = np.exp(-4 * (x**2 + y**2 + z**2)).astype(np.float32)
    values[:6] = 1e20
    values[12, 3, 4] = -50
    return values


@cases("turntable.txt")
def test_messages(case: Case, capsys: pytest.CaptureFixture[str]) -> None:
    case.check(capsys)


@pytest.mark.parametrize("arguments", [["init", "--output"], ["turntable", "-o"]])
def test_a_name_that_is_too_long(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    command, option = arguments
    assert main.run([command, "scan.npy", option, "x" * 300 + ".yaml"]) == 1
    assert capsys.readouterr().err.endswith(": the output cannot be written\n  got: File name too long\n")
