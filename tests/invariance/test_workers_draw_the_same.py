"""A frame has the same bytes and the same record from this process and from processes that Dask runs.

That the stage of every kind of scene survives its way to workers is shown in `test_transport.py`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace

import pytest
from distributed import Client
from film_stages import plan_of, stage_of_kind

from hsplat_cli.executors.cluster.cluster_drawing import ClusterDrawing
from hsplat_cli.executors.cluster.connection import connect_locally
from hsplat_cli.terminal import Reporter
from renderer.accuracy import open_prober
from renderer.draw import Rasterizer
from renderer.job import draw_frames
from renderer.scene import Scene

NUMBERS = [*range(8), 2]


@pytest.fixture(scope="module")
def client() -> Iterator[Client]:
    with connect_locally(2) as client:
        yield client


@pytest.mark.parametrize("kind", ["plain", "transparent", "float32, splats, shading", "overlay"])
def test_the_same_bytes(rasterizer_for: Callable[[Scene], Rasterizer], client: Client, kind: str) -> None:
    plan = plan_of(stage_of_kind(kind))
    rasterizer = rasterizer_for(plan.stage.scene)
    frames = draw_frames(plan.stage, NUMBERS, rasterizer, plan.controller, open_prober(plan.stage, 2))
    expected = [frame.measured() for frame in frames]
    assert all((frame.record.accuracy is None) == (kind == "overlay") for frame in expected)
    with closing(ClusterDrawing(client, "--workers 2", plan, Reporter())) as drawing:
        found = list(drawing.draw(NUMBERS))
    assert [result.record.frame for result in found] == NUMBERS
    for one, other in zip(found, expected, strict=True):
        assert one.picture.png == other.picture.png
        device = rasterizer.device
        assert replace(one.record, seconds={}) == replace(other.record, seconds={}, device=device)
