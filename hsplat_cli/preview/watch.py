"""Watches the file of a scene, and draws the scene when the file changes: coarse at once, then finer."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from hsplat_cli.preview.studio import Shot, Studio, small_scene
from hsplat_cli.scenes import SceneRequest, load_job
from renderer.draw import open_rasterizer
from renderer.errors import HsplatError, InputError
from renderer.frame import StageMaker
from renderer.scene import FilmScene, min_tolerance, with_tolerance
from renderer.system import num_cores
from renderer.volume import Volume, sampled_volume

# Longer side, in pixels, and finest tolerance of each picture that is drawn after a change, one after the other.
_STEPS = ((256, 1.0), (512, 0.3), (512, 0.0))
# Largest number of voxels along each axis in the first picture after a change, if layers have to be made again.
_MOST_AT_ONCE = 128
# Seconds between two looks at the file of the scene.
_POLL_S = 0.1
# Seconds without a change after which the file of the scene is read: an editor may write it in pieces.
_SETTLED_S = 0.05


@dataclass(frozen=True)
class State:
    """Holds a state of the page.

    number: the number of the state, which rises. shot: the last picture that could be drawn. error: the error of the
    scene, if it has one.
    """

    number: int
    shot: Shot | None = None
    error: str = ""


def watch(request: SceneRequest, show: Callable[[State], object], keeps_on: Callable[[], bool] = lambda: True) -> None:
    """Call `show` with each state of a scene, until an interrupt.

    Mistakes in the scene are shown, with the last picture that could be drawn. keeps_on: a function that is called
    while nothing changes, and returns whether to go on.
    """
    state, maker = State(0), StageMaker(num_cores(), any_tolerance=True)
    for mark in _changes(request.path, keeps_on):
        try:
            if mark is None:
                raise InputError("no such file; it is waited for", where=str(request.path))
            for shot in _shots(load_job(request, "nothing").scene, maker):
                state = State(state.number + 1, shot)
                show(state)
                if _mark(request.path) != mark:
                    break
        except HsplatError as error:
            if _mark(request.path) == mark:
                state = replace(state, number=state.number + 1, error=str(error))
                show(state)


def _changes(path: Path, keeps_on: Callable[[], bool]) -> Iterator[tuple[int, ...] | None]:
    """Yield the time, size and inode of a file, at first and after each change; None while the file is not there."""
    known: tuple[int, ...] | None = ()
    while keeps_on():
        mark = _mark(path)
        if mark != known:
            time.sleep(_SETTLED_S)
            if _mark(path) == mark:
                known = mark
                yield mark
        else:
            time.sleep(_POLL_S)


def _mark(path: Path) -> tuple[int, ...] | None:
    """Return the time, size and inode of a file, which differ after a change; None without the file."""
    try:
        status = os.stat(path)
    except OSError:
        return None
    return status.st_mtime_ns, status.st_size, status.st_ino


def _shots(scene: FilmScene, maker: StageMaker) -> Iterator[Shot]:
    """Yield ever finer pictures of a scene's first frame, or of its middle frame if something moves."""
    frame = scene.num_frames // 2 if scene.moves else 0
    wanted = min_tolerance(small_scene(scene, 1).error)
    with open_rasterizer(scene) as rasterizer:
        studio, drawn = Studio(rasterizer, maker), set[tuple[int, float]]()
        for side, finest in _STEPS:
            tolerance, start = max(finest, wanted), time.perf_counter()
            if (side, tolerance) not in drawn:
                small = with_tolerance(small_scene(scene, side), tolerance)
                some = None if drawn else _some_voxels(small, maker)
                drawn.add((side, tolerance))
                shot = studio.shoot(small, frame, "", "", some)
                seconds = time.perf_counter() - start
                part = ", of some of the voxels" * (some is not None)
                yield replace(shot, caption=f"frame {frame} at tolerance {tolerance:g}{part}, {seconds:.2f} s")


def _some_voxels(scene: FilmScene, maker: StageMaker) -> list[Volume] | None:
    """Return some voxels of each volume, for a first picture; None if drawing all voxels takes no longer.

    Drawing all voxels takes no longer for small volumes, and for layers that are kept. Volumes that are not read yet,
    or have labels, colours or a mask, also give None.
    """
    if not maker.layers or scene.moves:
        return None
    still, tolerance = scene.at(0), min_tolerance(scene.error)
    volumes = maker.volumes_of(still)
    is_kept = maker.layers.keys() >= {*maker.digests_of(still, tolerance)}
    are_plain = not any(volume.is_labels or volume.colors is not None or volume.mask is not None for volume in volumes)
    is_large = max(max(volume.shape_xyz) for volume in volumes) > _MOST_AT_ONCE
    return (
        [sampled_volume(volume, _MOST_AT_ONCE) for volume in volumes]
        if is_large and are_plain and not is_kept
        else None
    )
