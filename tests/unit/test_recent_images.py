"""Images that were read last, and a series whose files change."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from dicom_files import NORMAL, write_series
from this_process import read_here
from volume_files import read

from renderer.readers import Image, ImageRequest, RecentImages


def image(number: int) -> Image:
    return Image(np.full((1, 1, 10), number, np.uint8), np.eye(4))


class Store:
    """Images of 10 bytes by their numbers, and the numbers that were made because they were not kept."""

    def __init__(self, most_bytes: int) -> None:
        self.images, self.made = RecentImages(lambda _: most_bytes), list[int]()

    def get(self, source: str, number: int, state: int = 0) -> int:
        def make() -> Image:
            self.made.append(number)
            return image(number)

        return int(self.images.get(ImageRequest(source, number, (((source, 0, 0, state),),)), make).values[0, 0, 0])


def test_the_image_that_was_not_used_for_the_longest_time_goes_first() -> None:
    store = Store(most_bytes=20)
    assert [store.get(str(number), number) for number in (1, 2, 1, 3, 1, 2)] == [1, 2, 1, 3, 1, 2]
    assert store.made == [1, 2, 3, 2]  # 3 took the place of 2, which was used before 1


def test_steps_that_do_not_fit_are_read_again_and_the_others_are_kept() -> None:
    """A film asks for all its steps twice, in the same order."""
    store = Store(most_bytes=39)
    store.get("another film", 7)
    assert [store.get("film", number) for number in (1, 2, 3, 4, 5, 1, 2, 3, 4, 5)] == [1, 2, 3, 4, 5] * 2
    assert store.made == [7, 1, 2, 3, 4, 5, 4, 5]


def test_an_image_of_a_changed_file_leaves_its_place() -> None:
    store = Store(most_bytes=20)
    for state in (0, 1, 1):
        store.get("film", 1, state)
    store.get("film", 2)
    store.get("film", 2)
    assert store.made == [1, 1, 2]


def test_an_image_larger_than_the_store_is_not_kept_and_values_are_read_only() -> None:
    store = Store(most_bytes=5)
    request = ImageRequest("film", 1, ())
    assert not store.images.get(request, lambda: image(1)).values.flags.writeable
    assert store.images.get(request, lambda: image(2)).values[0, 0, 0] == 2


def test_a_change_of_a_file_beside_the_header_is_seen(tmp_path: Path) -> None:
    header, data = tmp_path / "a.nhdr", tmp_path / "a.raw"
    lines = "NRRD0004", "type: uint8", "dimension: 3", "sizes: 2 2 2", "encoding: raw", "data file: a.raw", ""
    header.write_text("\n".join(lines))
    found = []
    for number in (1, 2):
        data.write_bytes(bytes([number]) * 7 + b"\0")
        os.utime(data, (number, number))
        found += [int(read(header).values[0, 0, 0]) for _ in range(2)]
    assert found == [1, 1, 2, 2]


def test_a_step_is_decoded_once_until_a_file_of_the_series_changes(tmp_path: Path, monkeypatch) -> None:
    calls = list[Path]()

    def counted(reader: str, path: Path, **choice: object) -> Image:
        calls.append(path)
        return read_here(reader, path, **choice)

    monkeypatch.setattr("renderer.readers.volume_reading.read_isolated", counted)
    write_series(tmp_path, [k * NORMAL for k in range(3)])
    first = read(tmp_path)
    assert read(tmp_path, crop=((0, 2), None, None)).shape_xyz[0] == 2
    assert len(calls) == 1
    write_series(tmp_path, [k * NORMAL for k in range(4)])
    assert read(tmp_path).shape_xyz[2] == first.shape_xyz[2] + 1
    assert len(calls) == 2
    with pytest.raises(ValueError, match="read-only"):
        first.values[0, 0, 0] = 1
