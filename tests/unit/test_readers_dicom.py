"""DICOM series: order, tilted gantries, rescaling per slice, and series that are no volume."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dicom_files import COLUMN, NORMAL, ROW, image_fields, save, write_series, write_slice
from volume_files import read, refused

pytestmark = pytest.mark.usefixtures("one_process")


def test_slices_lie_where_they_say(tmp_path):
    planes = write_series(tmp_path, [np.array([1.0, 2.0, 3.0]) + 1.5 * k * NORMAL for k in range(4)])
    volume = read(tmp_path)
    np.testing.assert_array_equal(volume.values, planes)
    expected = np.column_stack([0.5 * ROW, 0.25 * COLUMN, 1.5 * NORMAL, [1, 2, 3]])
    np.testing.assert_allclose(volume.world_from_index[:3], expected, atol=1e-9)  # ten digits in the file


def test_tilted_gantry_is_sheared(tmp_path):
    step = 2.0 * NORMAL + 0.7 * COLUMN
    write_series(tmp_path, [k * step for k in range(4)])
    np.testing.assert_allclose(read(tmp_path).world_from_index[:3, 2], step, atol=1e-9)


def test_rescale_slope_may_differ_from_slice_to_slice(tmp_path):
    for k in range(3):
        write_slice(tmp_path / f"{k}.dcm", np.full((6, 5), 10.0), k * NORMAL)
    slope_element = b"\x28\x00\x53\x10\x02\x00\x00\x00"
    data = (tmp_path / "1.dcm").read_bytes()
    assert data.count(slope_element + b"1 ") == 1
    (tmp_path / "1.dcm").write_bytes(data.replace(slope_element + b"1 ", slope_element + b".5"))
    # Stored is 10 - intercept = 1010, and the intercept is -1000.
    assert read(tmp_path).values[:, 0, 0].tolist() == [10.0, 0.5 * 1010 - 1000, 10.0]


def test_colours_are_components(tmp_path):
    colours = np.arange(90, dtype=np.uint8).reshape(6, 5, 3)
    dataset = image_fields(colours[..., 0], SamplesPerPixel=3, PhotometricInterpretation="RGB", PlanarConfiguration=0)
    dataset.PixelData = colours.tobytes()
    save(tmp_path / "a.dcm", dataset)
    first = read(tmp_path / "a.dcm")
    np.testing.assert_array_equal(first.values[0], colours[..., 0])
    hint = "; `component: color` draws the colours"
    assert first.note == f"3 components (R, G, B); the first is drawn; `component: k` chooses another{hint}"
    np.testing.assert_array_equal(read(tmp_path / "a.dcm", component=2).values[0], colours[..., 2])


def test_small_unevenness_is_allowed(tmp_path):
    write_series(tmp_path, [k * NORMAL + 0.01 * (k % 2) * NORMAL for k in range(5)])
    np.testing.assert_allclose(read(tmp_path).spacing[2], 1.0, atol=1e-9)


def test_slices_of_another_size_are_refused(tmp_path):
    write_series(tmp_path, [k * NORMAL for k in range(3)])
    write_slice(tmp_path / "other.dcm", np.zeros((7, 5)), 3 * NORMAL)
    assert refused(tmp_path, match="the slices of this series differ in their size").got == "5 x 7 in other.dcm"


def test_many_series_are_listed_in_part(tmp_path):
    for k in range(20):
        write_slice(
            tmp_path / f"{k:02}.dcm", np.zeros((6, 5)), NORMAL, uid=f"1.2.3.{100 + k}", name=f"a scan of a head {k}"
        )
    error = refused(tmp_path, match="this folder holds 20 DICOM series, and one is rendered")
    shown = "; ".join(f'"a scan of a head {k}", 1 file from {k:02}.dcm' for k in range(7))
    assert error.got == f"{shown} and 13 more"


def test_links_to_nothing_beside_a_series_are_ignored(tmp_path):
    planes = write_series(tmp_path, [k * NORMAL for k in range(3)])
    (tmp_path / ".#notes").symlink_to("someone@somewhere")
    np.testing.assert_array_equal(read(tmp_path).values, planes)


def cut(path: Path, place: int) -> None:
    path.write_bytes(path.read_bytes()[:place])


def link(path: Path, target: str) -> None:
    path.unlink()
    path.symlink_to(target)


@pytest.mark.parametrize(
    ("name", "damage"),
    [
        ("99.dcm", lambda path: link(path, "gone.dcm")),
        ("99.dcm", lambda path: link(path, "/dev/zero")),
        *((name, lambda path: cut(path, -20)) for name in ("97.dcm", "98.dcm", "99.dcm")),
        ("99.dcm", lambda path: cut(path, path.read_bytes().index(b"\x20\x00\x0d\x00"))),  # before its series
        ("99.dcm", lambda path: cut(path, path.read_bytes().index(b"1.2.3.4\0") + 4)),  # in the name of its series
        ("98.dcm", lambda path: cut(path, path.read_bytes().index(b"\x28\x00\x30\x00"))),  # before its lengths
    ],
)
def test_damaged_slices_are_named(tmp_path, name, damage):
    """The search for series passes over some; at an end of the stack no gap would tell."""
    write_series(tmp_path, [k * NORMAL for k in range(3)])
    damage(tmp_path / name)
    assert refused(tmp_path, match="this DICOM slice cannot be read").where == str(tmp_path / name)


@pytest.mark.parametrize("num_slices", [2, 3])
def test_files_of_several_slices_each_are_times_if_numbered(tmp_path, num_slices):
    for k in range(2):
        stored = np.full((num_slices, 6, 5), k, np.int16)
        save(tmp_path / f"{k}.dcm", image_fields(stored, SpacingBetweenSlices="2"))
    error = refused(tmp_path, match="two slices of this series are at the same position")
    assert error.got == "0.dcm and 1.dcm, which no field tells apart"
    for k in range(2):
        stored = np.full((num_slices, 6, 5), k, np.int16)
        save(tmp_path / f"{k}.dcm", image_fields(stored, SpacingBetweenSlices="2", InstanceNumber=str(2 - k)))
    np.testing.assert_array_equal(read(tmp_path, time=0).values, np.ones((num_slices, 6, 5)))
    np.testing.assert_array_equal(read(tmp_path, time=1).values, np.zeros((num_slices, 6, 5)))


PLACES = [
    ((0, 1, 1, 2, 3), "at the same position", "97.dcm and 98.dcm; there are 1 to 2 at a position", ""),
    ((0, 1, 2, 3.4, 4.8), "not evenly spaced", "gaps from 1 to 1.4; ", "resample the series to even spacing, "),
    # Twice as far from the fifth on: a slice each is not missing there.
    (
        (0, 1, 2, 3, 4, 6, 8, 10),
        "not evenly spaced",
        "gaps from 1 to 2; ",
        ", or put slices of one distance into a folder",
    ),
    (
        (0, 1, 2, 4, 5, 6, 9),
        "missing",
        "about 3 missing; the first gap, 2, is between 97.dcm and 96.dcm",
        "copy the whole",
    ),
]


@pytest.mark.parametrize(("places", "message", "got", "hint"), PLACES)
def test_uneven_series_are_refused(tmp_path, places, message, got, hint):
    write_series(tmp_path, [place * NORMAL for place in places])
    error = refused(tmp_path, match=message)
    assert error.got.startswith(got) and hint in (error.hint or "")
