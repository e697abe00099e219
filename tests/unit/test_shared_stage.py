"""A stage moves to memory that other processes can map."""

from __future__ import annotations

import os
import resource
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest
from film_stages import PLAIN, stage_of

from hsplat_cli.executors.workers.shared_stage import map_stage, share_stage
from renderer.errors import RenderError
from renderer.frame import Stage


@pytest.fixture(scope="module")
def stage() -> Stage:
    return stage_of(PLAIN)


@contextmanager
def shared(stage: Stage) -> Iterator[int]:
    """Yield the descriptor of the shared stage."""
    descriptor = share_stage(stage)
    try:
        yield descriptor
    finally:
        os.close(descriptor)


def test_every_mapping_has_the_stage_and_outlives_the_descriptor(stage: Stage) -> None:
    with shared(stage) as descriptor:
        mappings = [map_stage(descriptor) for _ in range(2)]
    for mapped in mappings:
        assert mapped.scene == stage.scene
        assert (mapped.volume.values == stage.volume.values).all()
        assert (mapped.pyramid.levels[0].means == stage.pyramid.levels[0].means).all()


def test_a_change_of_one_mapping_does_not_show_in_another(stage: Stage) -> None:
    """The mapping is writable, so that compiled code sees the same kind of array."""
    with shared(stage) as descriptor:
        one, other = map_stage(descriptor), map_stage(descriptor)
    assert stage.order_blending.nearby_from_sphere.flags.writeable
    one.order_blending.nearby_from_sphere[:] = 7.0
    assert np.array_equal(other.order_blending.nearby_from_sphere, stage.order_blending.nearby_from_sphere)


@pytest.mark.parametrize("has_memory_files", [True, False])
def test_shared_memory_has_no_name(stage: Stage, has_memory_files: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Systems without files in memory get a file on disk."""
    if not has_memory_files:
        monkeypatch.delattr(os, "memfd_create")
    with shared(stage) as descriptor:
        assert os.fstat(descriptor).st_nlink == 0
        assert not os.get_inheritable(descriptor)
        assert (map_stage(descriptor).volume.values == stage.volume.values).all()


@contextmanager
def little_room() -> Iterator[None]:
    """Limit the size of the files that this process writes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_too_little_room_is_an_error_and_leaves_no_descriptor(stage: Stage) -> None:
    descriptors = len(os.listdir("/proc/self/fd"))
    with pytest.raises(RenderError) as raised, little_room():
        share_stage(stage)
    assert str(raised.value) == (
        "the volume cannot be shared with the processes that draw\n"
        "  got: File too large\n"
        "  hint: --workers 1 needs less memory"
    )
    assert len(os.listdir("/proc/self/fd")) == descriptors
