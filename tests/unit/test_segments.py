"""Segments of 3D Slicer that overlap in layers are one volume of labels, which everything shows alike."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from volume_files import read

from renderer.readers import read_volume
from renderer.scene import FileSource, VolumeSpec
from renderer.suggest import suggest_for
from renderer.volume import Array, Label

RED, GREEN, BLUE = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
HEADER = "NRRD0004\ntype: uint8\ndimension: {}\nsizes: {}\nspacings: {}\nkinds: {}\nencoding: {}\n"


def parts() -> dict[str, Array]:
    """Return a body, an organ inside of it, and a tube that begins in the organ and ends outside of the body."""
    z, y, x = np.meshgrid(np.arange(6), np.arange(7), np.arange(12), indexing="ij")
    body = (x < 8) & (y < 6)
    organ = (x > 1) & (x < 6) & (y > 1) & (y < 5) & (z > 0) & (z < 5)
    tube = (x > 4) & (y == 3) & (z == 3)
    return {"body": body, "organ": organ, "tube": tube}


def write(path: Path, layers: list[Array], keys: str, encoding: str = "raw") -> Path:
    stored = np.stack(layers, axis=-1).astype(np.uint8)
    sizes = " ".join(map(str, stored.shape[::-1]))
    header = HEADER.format(4, sizes, "nan 1 1 2", "list domain domain domain", encoding)
    data = stored.tobytes() if encoding == "raw" else " ".join(map(str, stored.ravel())).encode()
    path.write_bytes(f"{header}{keys}\n".encode() + data)
    return path


def keys_of(*segments: tuple[str, str, int | None, int | None]) -> str:
    """Return the lines of segments: name, colour, layer and value, the last two left out if None."""
    lines = []
    for number, (name, color, layer, value) in enumerate(segments):
        lines += [f"Segment{number}_Name:={name}", f"Segment{number}_Color:={color}"]
        lines += [f"Segment{number}_Layer:={layer}"] * (layer is not None)
        lines += [f"Segment{number}_LabelValue:={value}"] * (value is not None)
    return "\n".join(lines) + "\n"


def newer(path: Path, encoding: str = "raw") -> Path:
    body, organ, tube = parts().values()
    keys = keys_of(("body", "1 0 0", 0, 1), ("organ", "0 1 0", 1, 1), ("tube", "0 0 1", 2, 1))
    return write(path, [body, organ, tube], keys, encoding)


def older(path: Path) -> Path:
    keys = keys_of(("body", "1 0 0", None, None), ("organ", "0 1 0", None, None), ("tube", "0 0 1", None, None))
    return write(path, list(parts().values()), keys)


FORMS = {"newer": newer, "text": partial(newer, encoding="text"), "older": older}


@pytest.mark.parametrize("form", FORMS)
def test_overlapping_segments_are_all_there(tmp_path: Path, form: str) -> None:
    volume = read(FORMS[form](tmp_path / "a.seg.nrrd"))
    body, organ, tube = parts().values()
    expected = np.where(tube, 3, np.where(organ, 2, np.where(body, 1, 0)))  # the tube is the smallest, then the organ
    np.testing.assert_array_equal(volume.values, expected)
    assert volume.labels == (Label(1, "body", RED), Label(2, "organ", GREEN), Label(3, "tube", BLUE))
    assert volume.channels == () and volume.spacing.tolist() == [1, 1, 2]
    num_shared = np.count_nonzero(np.sum([body, organ, tube], axis=0) > 1)
    assert f"{num_shared} voxels in several segments belong to the smallest of them" in (volume.note or "")


def test_values_that_are_unique_stay(tmp_path: Path) -> None:
    body, organ, tube = parts().values()
    keys = keys_of(("tube", "0 0 1", 1, 9), ("body", "1 0 0", 0, 300), ("organ", "0 1 0", 1, 40))
    path = write(tmp_path / "a.seg.nrrd", [body, organ], keys)
    stored = np.stack([300 * body, np.where(tube, 9, 40 * organ)], axis=-1).astype("<u2")
    header = path.read_bytes().partition(b"\n\n")[0].replace(b"uint8", b"uint16\nendian: little")
    path.write_bytes(header + b"\n\n" + stored.tobytes())
    volume = read(path)
    np.testing.assert_array_equal(volume.values, np.where(tube, 9, np.where(organ, 40, 300 * body)))
    assert [(each.value, each.name) for each in volume.labels] == [(9, "tube"), (40, "organ"), (300, "body")]
    assert "anew" not in (volume.note or "")


def test_one_layer_has_its_own_segments_and_names_the_others(tmp_path: Path) -> None:
    volume = read(newer(tmp_path / "a.seg.nrrd"), component=1)
    np.testing.assert_array_equal(volume.values, parts()["organ"])
    assert volume.labels == (Label(1, "organ", GREEN),)
    assert "segments in other layers are left out: body, tube" in (volume.note or "")


def test_voxels_of_no_segment_are_counted(tmp_path: Path) -> None:
    body, organ, tube = parts().values()
    keys = keys_of(("body", "1 0 0", 0, 1), ("organ", "0 1 0", 1, 1))
    volume = read(write(tmp_path / "a.seg.nrrd", [body, organ + 2 * (tube & ~organ)], keys))
    num_lost = np.count_nonzero(tube & ~organ & ~body)
    assert f"{num_lost} voxels in no segment are left out" in (volume.note or "")


def test_a_plane_of_segments_is_a_volume(tmp_path: Path) -> None:
    stored = np.array([[[1, 0], [1, 1], [0, 1]]], np.uint8)
    keys = keys_of(("a", "1 0 0", 0, 1), ("b", "0 1 0", 1, 1))
    header = HEADER.format(3, "2 3 1", "nan 1 1", "list domain domain", "raw")
    (tmp_path / "a.nrrd").write_bytes(f"{header}{keys}\n".encode() + stored.tobytes())
    assert read(tmp_path / "a.nrrd").values.tolist() == [[[1, 2, 2]]]


def test_what_is_suggested_shows_all_segments(tmp_path: Path) -> None:
    found = suggest_for(VolumeSpec(FileSource(newer(tmp_path / "a.seg.nrrd"))), read_volume)
    labels: Any = found.suggestion.transfer.labels
    assert found.layers == () and found.volume.component is None
    assert labels.show == (1, 2, 3) and dict(labels.names) == {1: "body", 2: "organ", 3: "tube"}
    assert dict(labels.colors) == {1: RED, 2: GREEN, 3: BLUE}
