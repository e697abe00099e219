"""Materials are told apart by their histogram and by where their voxels lie; colours by how they look."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from kinds_of_data import KINDS, blurred, noise, sample_of, suggested

from renderer.statistics import find_background, foreground_threshold, material_edges, otsu_thresholds
from renderer.suggest import distinct_colors, to_lab

N = 96


def shells(*values: float) -> np.ndarray:
    """Boxes in one another, each 12 voxels thick, with some noise."""
    cube = np.zeros((N, N, N))
    for k, value in enumerate(values, start=1):
        cube[12 * k : -12 * k, 12 * k : -12 * k, 12 * k : -12 * k] = value
    return blurred(cube) + noise(3, N)


@pytest.mark.parametrize("count", [2, 3, 4])
def test_thresholds_have_the_largest_variance_between_classes(count: int) -> None:
    """Against all ways to cut a small histogram."""
    counts = np.random.Generator(np.random.PCG64(count)).integers(0, 30, 14).astype(float)
    bins = np.arange(14.0)

    def spread(starts: tuple[int, ...]) -> float:
        parts = np.split(np.arange(14), starts)
        return sum((counts[part] @ bins[part]) ** 2 / counts[part].sum() for part in parts if counts[part].sum())

    best = max(combinations(range(1, 14), count - 1), key=spread)
    assert spread(otsu_thresholds(counts, count)) == pytest.approx(spread(best))


@pytest.mark.parametrize(("values", "count"), [((200.0,), 1), ((90.0, 200.0), 2), ((60.0, 130.0, 200.0), 3)])
def test_each_material_is_a_class_and_edges_are_none(values: tuple[float, ...], count: int) -> None:
    sample = sample_of(shells(*values))
    ends = material_edges(sample, foreground_threshold(sample, find_background(sample)))
    assert len(ends) == count + 1
    at = [sample.normalize(value) for value in values]
    assert all(low < value < high + 0.05 for low, value, high in zip(ends, at, ends[1:], strict=False))


def test_the_object_begins_above_the_noise_and_below_the_thinnest_material() -> None:
    sample = sample_of(shells(60.0, 200.0))
    first = foreground_threshold(sample, find_background(sample))
    assert sample.normalize(5.0) < first < sample.normalize(55.0)


def test_colours_are_far_from_each_other_and_from_black() -> None:
    seen = to_lab(np.array(distinct_colors([(0.9, 0.47, 0.29)], 60)))
    distances = np.linalg.norm(seen[:, None] - seen[None], axis=2) + 1e3 * np.eye(60)
    assert distances.min() > 15 and seen[:, 0].min() > 40
    assert np.hypot(seen[:, 1], seen[:, 2]).max() < 81  # none outshines the others


def test_lab_of_known_colours() -> None:
    """White, black, and the red of sRGB."""
    known = to_lab(np.array([[1.0, 1.0, 1.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))
    np.testing.assert_allclose(known, [[100, 0, 0], [0, 0, 0], [53.24, 80.09, 67.20]], atol=0.2)


def test_labels_are_seen_on_black() -> None:
    labels = suggested(KINDS["many labels"][0]).transfer.labels
    assert labels is not None
    colors = np.array([style.color for style in labels.styles if style.opacity > 0])
    assert len(np.unique(colors, axis=0)) == 64 and to_lab(colors)[:, 0].min() > 40
