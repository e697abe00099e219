"""Images that were read last, and a series whose files change."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from dicom_files import NORMAL, write_series
from volume_files import read

from renderer.readers import Image, RecentImages, read_isolated


def image(number: int) -> Image:
    return Image(np.full((1, 1, 10), number, np.uint8), np.eye(4))


def test_the_image_that_was_not_used_for_the_longest_time_goes_first() -> None:
    made = list[int]()

    def get(number: int) -> int:
        return int(images.get(number, lambda: (made.append(number), image(number))[1]).values[0, 0, 0])

    images = RecentImages(most_bytes=20)
    assert [get(number) for number in (1, 2, 1, 3, 1, 2)] == [1, 2, 1, 3, 1, 2]
    assert made == [1, 2, 3, 2]  # 3 took the place of 2, which was used before 1


def test_an_image_larger_than_the_store_is_not_kept_and_values_are_read_only() -> None:
    images = RecentImages(most_bytes=5)
    assert not images.get(1, lambda: image(1)).values.flags.writeable
    assert images.get(1, lambda: image(2)).values[0, 0, 0] == 2


def test_a_step_is_decoded_once_until_a_file_of_the_series_changes(tmp_path: Path, monkeypatch) -> None:
    calls = list[Path]()

    def counted(reader: str, path: Path, **choice: object) -> Image:
        calls.append(path)
        return read_isolated(reader, path, **choice)

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
