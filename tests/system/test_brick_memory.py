"""The memory for bricks is recorded, and changes no byte of a film."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from small_scene import engine_block, sidecar, small_tree

from hsplat_cli import main

# Bytes of a brick of 16^3 voxels and their halo, kept as voxels of a byte, and of voxels that are lit.
PLAIN, LIT = 18**3, 20**3
# Bytes of a brick of cells of four numbers.
FOUR = 16 * 18**3


@pytest.mark.slow
@pytest.mark.parametrize("shading", [pytest.param(None, id="plain"), pytest.param({}, id="lit")])
def test_films_have_the_same_bytes(folder: Path, scheduler: str, shading: dict[str, float] | None) -> None:
    tree = small_tree(frames=3, volume=engine_block(64, 64, 48)) | ({} if shading is None else {"shading": shading})
    (folder / "scene.yaml").write_text(json.dumps(tree))
    films, limits = set[bytes](), list[int]()
    on_cluster = ["--scheduler", scheduler, "--memory=1MB"]
    for options in ([], ["--memory", "1"], ["--memory", "600kB"], ["--memory=1GiB"], on_cluster):
        assert main.run(["render", "scene.yaml", "--quiet", "--force", *options]) == 0
        films.add(Path("film.mp4").read_bytes())
        found = sidecar().get("memory")
        assert (found is None) == (options is on_cluster)
        if found is not None:
            limits.append(found["limit"])
            most = 4 * 4 * 3 * (PLAIN if shading is None else LIT) + (2 * 2 * 2 + 1) * FOUR
            assert most / 4 < found["needed"] <= most  # bricks that show nothing need nothing
    assert len(films) == 1
    assert limits[1:] == [1, 600_000, 2**30]
    assert limits[0] > 2**26
