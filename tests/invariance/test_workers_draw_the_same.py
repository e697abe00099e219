"""A frame has the same bytes from this process and from workers, with any number of threads.

That the stage of every kind of scene survives its way to workers is shown in `test_transport.py`.
"""

from __future__ import annotations

import pytest
from film_stages import stage_of_kind

from hsplat_cli.executors import draw_locally
from hsplat_cli.executors.workers.pool import open_pool
from renderer.draw import GLRasterizer

NUMBERS = [*range(8), 2]


@pytest.mark.parametrize(
    ("kind", "num_workers", "threads_per_worker"),
    [("plain", 2, 4), ("transparent", 1, 0), ("float32, splats, shading", 1, 1), ("overlay", 1, 1)],
)
def test_the_same_bytes(
    rasterizer: GLRasterizer, monkeypatch: pytest.MonkeyPatch, kind: str, num_workers: int, threads_per_worker: int
) -> None:
    monkeypatch.delenv("LP_NUM_THREADS", raising=False)
    stage = stage_of_kind(kind)
    expected = list(draw_locally(stage, NUMBERS, rasterizer))
    with open_pool(stage, num_workers, threads_per_worker=threads_per_worker) as pool:
        found = list(pool.draw(NUMBERS))
    assert [result.number for result in found] == NUMBERS
    for one, other in zip(found, expected, strict=True):
        assert one.picture.png == other.picture.png
        assert one.picture.pixels.shape == other.picture.pixels.shape
        assert one.picture.pixels.tobytes() == other.picture.pixels.tobytes()
        assert one.record.keys() == other.record.keys()
        assert one.record | {"seconds": 0} == other.record | {"seconds": 0}
