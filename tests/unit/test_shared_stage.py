"""A stage moves to memory that other processes can map; where there is none that is an error."""

from __future__ import annotations

import os
import resource
from collections.abc import Iterator
from contextlib import closing, contextmanager

import numpy as np
import pytest
from film_stages import PLAIN, stage_of

from hsplat_cli.executors.workers.shared_stage import SharedStage, map_stage
from renderer.errors import RenderError
from renderer.frame import Stage


@pytest.fixture(scope="module")
def stage() -> Stage:
    return stage_of(PLAIN)


def test_it_is_the_same_wherever_it_is_mapped(stage: Stage) -> None:
    with closing(SharedStage(stage)) as shared:
        other = map_stage(shared.descriptor)
    assert shared.stage.scene == other.scene == stage.scene  # the descriptor is closed, the memory there
    for mapped in (shared.stage, other):
        assert (mapped.volume.values == stage.volume.values).all()
        assert (mapped.pyramid.levels[0].means == stage.pyramid.levels[0].means).all()


def test_whoever_writes_writes_for_itself(stage: Stage) -> None:
    """Nobody does; the mapping is one that could, so that arrays are as they were to compiled code."""
    with closing(SharedStage(stage)) as shared:
        other = map_stage(shared.descriptor)
    assert stage.order_blending.nearby_from_sphere.flags.writeable
    shared.stage.order_blending.nearby_from_sphere[:] = 7.0
    assert np.array_equal(other.order_blending.nearby_from_sphere, stage.order_blending.nearby_from_sphere)


def test_it_has_no_name(stage: Stage) -> None:
    with closing(SharedStage(stage)) as shared:
        assert os.fstat(shared.descriptor).st_nlink == 0
        assert not os.get_inheritable(shared.descriptor)


@contextmanager
def little_room() -> Iterator[None]:
    """For the files of this process, its output among them: no longer than it takes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_no_room(stage: Stage) -> None:
    descriptors = len(os.listdir("/proc/self/fd"))
    with pytest.raises(RenderError) as raised, little_room():
        SharedStage(stage)
    assert str(raised.value) == (
        "the volume cannot be shared with the processes that draw\n"
        "  got: File too large\n"
        "  hint: --workers 1 needs less memory"
    )
    assert len(os.listdir("/proc/self/fd")) == descriptors


def test_without_memory_files(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    """On other systems there is a file on disk, which has no name either."""
    monkeypatch.delattr(os, "memfd_create")
    with closing(SharedStage(stage)) as shared:
        assert os.fstat(shared.descriptor).st_nlink == 0
        assert (map_stage(shared.descriptor).volume.values == stage.volume.values).all()
