"""Folders of TIFF slices, of which only the names say which is which: gaps, several stacks, and DICOM among them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dicom_files import image_fields, save
from transcripts import Case, cases
from volume_files import read, write_image

pytestmark = pytest.mark.usefixtures("one_process")


def write(folder: Path, names: list[str]) -> None:
    """Write a slice for each name, which holds its place among them."""
    for k, name in enumerate(names):
        plane = np.full((4, 5), k, np.uint8)
        if name.endswith(".dcm"):
            save(folder / name, image_fields(plane))
        else:
            write_image(folder / name, plane)


@pytest.mark.parametrize(
    "names",
    [
        ["s0.tif", "s1.tif", "s2.tif", "s3.tif"],
        ["s08.tif", "S09.TIF", "s10.tif", "s11.tif"],
        ["2024_z0.tif", "2024_z10.tif", "2024_z20.tif", "2024_z30.tif"],  # one number goes on, in steps
        ["z1_121503.tif", "z2_121504.tif", "z3_121509.tif", "z4_121511.tif"],  # a time that belongs to each
        ["121503_z1.tif", "121504_z2.tif", "121509_z3.tif", "121511_z4.tif"],
        ["only.tif"],
    ],
)
def test_names_of_one_stack(tmp_path: Path, names: list[str]) -> None:
    write(tmp_path, names)
    (tmp_path / "notes 7.txt").write_text("no slice")
    values = read(tmp_path).values
    assert values[:, 0, 0].tolist() == list(range(len(names)))


REFUSED = {
    "gap": [f"s{k:03}.tif" for k in range(20) if k not in (5, 6, 7)],
    "channels": [f"scan_ch{c}_z{z:02}.tif" for c in range(2) for z in range(4)],
    "prefixes": ["dapi_0.tif", "dapi_1.tif", "gfp_0.tif", "gfp_1.tif"],
    "twice": ["s1.tif", "s2.tif", "s02.tif", "s3.tif"],
    "dicom": ["s0.tif", "s1.tif", "a.dcm"],
}


@cases("slice_names.txt")
def test_messages(case: Case, folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    for name, names in REFUSED.items():
        Path(name).mkdir()
        write(Path(name), names)
    case.check(capfd)
