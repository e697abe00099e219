"""How exact is the light grid, and what does it cost? It writes a page.

The reference sends many rays in fine steps from random visible places. The page is docs/benchmarks/occlusion.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from light_reference import exact_occlusion, exact_shadow, sampled
from measuring import PAGES, THREADS, machine_line, medians_in_turns, parser_of, write_page
from scipy import ndimage

import renderer
from renderer.lighting import compute_light_grid
from renderer.readers import read_volume
from renderer.scene import ShadingSpec
from renderer.transfer import TransferFunction, make_transfer_function
from renderer.volume import Float64, Volume

PAGE = PAGES / "occlusion.md"
VOLUMES = {"engine": "engine.nhdr", "bonsai": "bonsai.nhdr", "head": "medical/headsq_quarter.nrrd"}
MAX_CELLS = (128, 64)
NUM_POINTS, LEAST_DEPTH, REPEATS = 1000, 1e-3, 3


def main() -> None:
    data = parser_of(__doc__).parse_args().data
    columns = (
        "volume | voxels | cells | voxels a cell | occlusion, RMSE | shadow, RMSE | occlusion, s | shadow, s | both, s"
    )
    lines = [line for name, file in VOLUMES.items() for line in rows(name, data / file)]
    write_page(PAGE, [machine_line(), "", f"| {columns} |", "| --- " * 9 + "|", *lines])


def rows(name: str, file: Path) -> Iterator[str]:
    """Yield a row for each size of the grid."""
    scene = renderer.suggest_scene(file)
    volume, shading = read_volume(scene.layers[0].volume), scene.layers[0].shading or ShadingSpec()
    transfer = make_transfer_function(scene.layers[0].transfer_function, volume.finest_spacing)
    points = visible_points(volume, transfer)
    for max_cells in MAX_CELLS:
        make = partial(compute_light_grid, volume, transfer, max_cells=max_cells, num_threads=THREADS)
        grid = make(replace(shading, occlusion=1.0, shadow=1.0))
        exact = (
            exact_occlusion(volume, transfer, points, grid.cell_size),
            exact_shadow(volume, transfer, points, grid.cell_size, shading.light),
        )
        stored = [sampled(each, grid.cell_size, points) for each in (grid.occlusion, grid.shadow)]
        errors = [float(np.sqrt(np.mean((a - b) ** 2))) for a, b in zip(stored, exact, strict=True)]
        works = [
            partial(make, replace(shading, occlusion=1.0)),
            partial(make, replace(shading, occlusion=0.0, shadow=1.0)),
            partial(make, replace(shading, occlusion=1.0, shadow=1.0)),
        ]
        seconds = medians_in_turns(works, REPEATS)
        cells = " x ".join(str(num - 2) for num in grid.occlusion.shape[::-1])
        voxels = " x ".join(map(str, volume.shape_xyz))
        figures = [f"{error:.4f}" for error in errors] + [f"{each:.2f}" for each in seconds]
        yield f"| {name} | {voxels} | {cells} | {grid.cell_size} | {' | '.join(figures)} |"


def visible_points(volume: Volume, transfer: TransferFunction) -> Float64:
    """Return random places (x, y, z) in voxels, float64 [NUM_POINTS, 3]."""
    depths = transfer.classify(volume.values)[1] * volume.finest_spacing
    rng, shape = np.random.default_rng(3), np.array(volume.shape_xyz)
    found = np.zeros((0, 3))
    while len(found) < NUM_POINTS:
        places = rng.random((NUM_POINTS, 3)) * shape - 0.5
        is_visible = ndimage.map_coordinates(depths, places.T[::-1], order=1, mode="nearest") > LEAST_DEPTH
        found = np.concatenate([found, places[is_visible]])
    return found[:NUM_POINTS]


if __name__ == "__main__":
    main()
