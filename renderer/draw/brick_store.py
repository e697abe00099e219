"""What a drawer of bricks keeps from picture to picture: bricks in atlases, and those that were made for them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Generic, TypeVar

import numpy as np
import numpy.typing as npt

from renderer.bricks import BrickBatch, Bricks, MeanCache
from renderer.draw.brick_atlas import Atlas, Texels
from renderer.draw.brick_view import BrickView, make_brick_view, mean_texels_by_key, scalar_texels_by_key
from renderer.threads import ThreadPool
from renderer.view import View

A = TypeVar("A", bound=Atlas)
# An atlas, which bricks of a picture belong there, and what makes them ready.
Kind = tuple[A, npt.NDArray[np.bool_], Texels]


class BrickCache(Generic[A]):
    """Atlases of scalars and of means; of_scalars, of_means: what makes one, of so many channels for so many keys.
    threads: that make bricks ready."""

    def __init__(
        self, of_scalars: Callable[[int, int], A], of_means: Callable[[int, int], A], threads: ThreadPool
    ) -> None:
        self._make_scalar_atlas, self._make_mean_atlas, self._threads = of_scalars, of_means, threads
        self._bricks: Bricks | None = None
        self._scalars: A | None = None
        self._means: A | None = None
        self._made = MeanCache(threads)
        self._picture: BrickView | None = None  # the last one, which may be brought and then drawn

    def begin(self, batch: BrickBatch, order: npt.NDArray[np.uint32], view: View) -> BrickView:
        """A picture for which there is room, as far as there may be: with less, bricks would come every time."""
        self._look_at(batch)
        if self._picture is None or not self._picture.is_of(batch, order, view):
            self._picture = make_brick_view(batch, order, view)
        for atlas, is_chosen, _ in self.kinds(self._picture):
            atlas.reserve(int(np.count_nonzero(is_chosen)))
        return self._picture

    def upload(self, batch: BrickBatch, order: npt.NDArray[np.uint32], view: View) -> bool:
        """Bring those bricks of `batch[order]` that are not there; whether there were any.

        Where there is no room for all of them, they come and go as they are drawn, and here nothing is done.
        """
        picture = self.begin(batch, order, view)
        kinds = [(atlas, picture.keys[chosen], texels) for atlas, chosen, texels in self.kinds(picture)]
        if any(len(keys) > atlas.max_slots for atlas, keys, _ in kinds):
            return False
        if not any(atlas.num_missing(keys) for atlas, keys, _ in kinds):
            return False
        self._made.begin(is_enabled=False)
        for atlas, keys, texels in kinds:
            atlas.place(keys, texels)
        return True

    def begin_frame(self, picture: BrickView) -> None:
        """Say that a picture is drawn now."""
        _, (means, is_mean, _) = self.kinds(picture)
        self._made.begin(is_enabled=int(np.count_nonzero(is_mean)) > means.max_slots)

    def kinds(self, picture: BrickView) -> tuple[Kind[A], Kind[A]]:
        """Of scalars and of means."""
        assert self._scalars is not None
        assert self._means is not None
        return (
            (self._scalars, ~picture.is_mean, partial(scalar_texels_by_key, picture.batch, self._threads)),
            (self._means, picture.is_mean, partial(mean_texels_by_key, picture.batch, self._made)),
        )

    def end_of_group(self, picture: BrickView, start: int, most: int) -> int:
        """Where a group of at most so many bricks ends that begins at `start`; there is room for each kind's."""
        part = slice(start, start + most)
        fits = [np.cumsum(is_chosen[part]) <= atlas.max_slots for atlas, is_chosen, _ in self.kinds(picture)]
        return start + int(np.count_nonzero(fits[0] & fits[1]))

    def forget(self) -> None:
        """Let go of all bricks."""
        for atlas in (self._scalars, self._means):
            if atlas is not None:
                atlas.release()
        self._scalars = self._means = None
        self._bricks, self._picture, self._made = None, None, MeanCache(self._threads)

    def _look_at(self, batch: BrickBatch) -> None:
        """Let go of what belongs to other bricks."""
        num_channels = 4 if batch.shading else 1
        if self._scalars is None or self._bricks is not batch.bricks or self._scalars.num_channels != num_channels:
            self.forget()
            grids = [level.visible_bounds.shape[:3] for level in batch.bricks.levels]
            self._scalars = self._make_scalar_atlas(num_channels, int(np.prod(grids[0])))
            self._means = self._make_mean_atlas(4, sum(int(np.prod(grid)) for grid in grids[1:]))
            self._bricks = batch.bricks
