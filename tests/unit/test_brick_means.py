"""Means that are recomputed when a brick is drawn equal those of a complete pyramid; the cache of recomputed means."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from dense_bricks import OBLIQUE, Shape, patches

from renderer.bricks import BRICK_LEVELS, BRICK_SIZE, PADDED_BRICK_SIZE, make_bricks, recompute_means, stored_means
from renderer.pyramid import Pyramid, build_pyramid, descendants, root_cells
from renderer.scene import ErrorSpec, PyramidSpec, ShadingSpec
from renderer.transfer import TransferFunction
from renderer.volume import Volume, make_volume

# Texels beyond a brick, at each of its faces.
HALO = 1

SOFT = TransferFunction(np.array([0.0, 100, 250]), np.eye(3), np.array([0.0, 0.0, 1.5]), 1.0)


def volume_of(shape: Shape, dtype: str) -> Volume:
    return make_volume((patches(shape, 3) * 250).astype(dtype), OBLIQUE, "patches")


def dense_nodes(pyramid: Pyramid, level: int) -> npt.NDArray[np.floating]:
    """[z, y, x, 4]: the stored means of a level, 0 where nothing is visible, and beyond the volume as far as bricks and
    their halos go."""
    shape = [((n - 1 >> (level + BRICK_LEVELS)) + 1) * BRICK_SIZE + 2 * HALO for n in pyramid.volume.values.shape]
    means = np.zeros((*shape, 4), pyramid.levels[0].means.dtype)
    nodes, cells = descendants(pyramid, *root_cells(pyramid), pyramid.num_levels, level)
    x, y, z = cells.T + HALO
    means[z, y, x] = pyramid.levels[level - 1].means[nodes]
    return means


@pytest.mark.parametrize(
    ("dtype", "spec", "error", "shading"),
    [
        ("uint8", PyramidSpec(), ErrorSpec(), None),
        ("uint16", PyramidSpec(precision="single"), ErrorSpec(), None),
        ("uint8", PyramidSpec("opacity"), ErrorSpec(), None),
        ("float32", PyramidSpec("opacity", "single"), ErrorSpec(measure="rms"), None),
        ("float32", PyramidSpec(), ErrorSpec(measure="rms", of="scalar"), None),
        ("uint8", PyramidSpec(), ErrorSpec(measure="rms"), ShadingSpec()),
    ],
    ids=["table", "single", "opacity", "segments", "scalar", "lit"],
)
@pytest.mark.parametrize("shape", [(1, 1, 1), (37, 66, 5), (20, 65, 129)], ids=str)
def test_means_are_those_of_a_complete_pyramid(
    shape: Shape, dtype: str, spec: PyramidSpec, error: ErrorSpec, shading: ShadingSpec | None
) -> None:
    """They are equal bit for bit, halo included, and so is everything that was stored."""
    volume = volume_of(shape, dtype)
    whole = build_pyramid(volume, SOFT, spec=spec, error=error, shading=shading)
    pyramid = make_bricks(volume, SOFT, spec=spec, error=error, shading=shading).pyramid
    assert pyramid.num_levels >= 3 and pyramid.finest_cut.level == 3
    for level in range(1, whole.num_levels + 1):
        dense = dense_nodes(whole, level)
        grid = [((n - 1) >> (level + BRICK_LEVELS)) + 1 for n in shape]
        cells = np.stack(np.indices(grid)[::-1], axis=-1).reshape(-1, 3).astype(np.int32)
        found = (recompute_means if level < 3 else stored_means)(pyramid, level, cells)
        for (x, y, z), got in zip((cells * BRICK_SIZE).tolist(), found, strict=True):
            np.testing.assert_array_equal(
                got, dense[z : z + PADDED_BRICK_SIZE, y : y + PADDED_BRICK_SIZE, x : x + PADDED_BRICK_SIZE]
            )
        assert (len(pyramid.levels[level - 1].errors) == 0) == (level < 3)
    for one, other in zip(pyramid.levels[2:], whole.levels[2:], strict=whole.num_levels >= 3):
        np.testing.assert_array_equal(one.means, other.means)
        np.testing.assert_array_equal(one.errors, other.errors)
