"""Which defects do probes notice? `python tests/bench/defects.py DATA` writes docs/benchmarks/defects.md.

Draws short films with a defect of drawing injected, and asks whether a few exact rays tell them from the film without.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
from measuring import PAGES, THREADS, machine_line, parser_of

import renderer
from renderer.accuracy import ErrorSamples, FrameProber, pool_samples, psnr
from renderer.bricks import BrickBatch, Bricks, mean_texels, scalar_texels
from renderer.draw import BrickRasterizer, brick_cache
from renderer.film import Pixels
from renderer.frame import Stage, Stopwatch, draw_frame, make_draw_list, make_primitive, prepare_stage
from renderer.frame.frame import DrawList
from renderer.frame.primitives import LOD
from renderer.scene import Scene
from renderer.transfer import TransferFunction, make_transfer_function
from renderer.volume import Float32, Int32, UInt32

PAGE = PAGES / "defects.md"
SIZE, NUM_FRAMES, TOLERANCE = (256, 256), 24, 0.1
RAYS = (64, 1024)
# Bricks of which the most important and a typical one are chosen, by these frames without them.
CANDIDATES, TRIAL_FRAMES = 24, (0, 8, 16)
EARLY_ALPHA = 0.5

HEAD = """# Which defects do probes notice?

Footprint: `integrated`. Measure again when the choice of pixels, the interval or the drawing of bricks changes.

`python tests/bench/defects.py DATA` writes this page. It draws films of {frames} frames, {width} x {height}, at
`tolerance: {tolerance:g}`, of scenes of `renderer.suggest_scene`, once without and once with each defect. A defect is
*noticed in the film* if the interval of the film's PSNR lies wholly below that of the film without it, and *in a frame*
if that of the frame does. *Differ by* compares the two films without any ray, as PSNR: infinite where they are the
same. What differs by less than the film's own error can hardly be noticed. Some frames lie below the film without any
defect, because they are less exact than the whole: the first row counts them.

Defects of one brick are tried on the one whose absence changes most and on a typical one (the median), of {candidates}
bricks that were drawn by lot. *Means of its parent*: it is drawn from the level above. *Halo off*: the halo has the
outermost cells of the brick itself.

{machine}
"""

Film = list[Pixels]
Change = Callable[[DrawList], DrawList]


class Subject(NamedTuple):
    """A scene on its stage, and all its bricks as they are drawn."""

    stage: Stage
    lod: LOD

    @property
    def batch(self) -> BrickBatch:
        """Return the bricks."""
        (batch,) = self.lod.batches
        assert isinstance(batch, BrickBatch)
        return batch


class Seen(NamedTuple):
    """What probes say of a film: by frame, and together."""

    frames: list[ErrorSamples]
    film: ErrorSamples


class Row(NamedTuple):
    """A defect, the PSNR between the films with and without it, and what probes say by number of rays."""

    name: str
    difference: float
    seen: dict[int, Seen]


def main() -> None:
    data = parser_of(__doc__).parse_args().data
    frames, (width, height) = NUM_FRAMES, SIZE
    of_what = {"frames": frames, "width": width, "height": height, "candidates": CANDIDATES, "machine": machine_line()}
    lines = [HEAD.format(**of_what, tolerance=TOLERANCE)]
    for name, (file, is_lit) in SCENES.items():
        scene = renderer.suggest_scene(data / file, size=SIZE, tolerance=TOLERANCE)
        path = replace(scene.camera.path, frames=NUM_FRAMES)
        scene = replace(scene, camera=replace(scene.camera, path=path), shading=scene.shading if is_lit else None)
        lines += section(name, measured(scene))
    PAGE.write_text("\n".join(lines), encoding="utf-8")


def measured(scene: Scene) -> list[Row]:
    """Measure a scene with every defect; the first row has none."""
    with prepare_stage(scene, clock=time.process_time, num_threads=THREADS) as stage:
        subject = staged(stage)
        probers = {num: FrameProber(stage, num, num_threads=THREADS) for num in RAYS}
        without = film(subject)

        def row(name: str, changed: Film) -> Row:
            found = Row(name, _difference(without, changed), {num: seen(probers[num], changed) for num in RAYS})
            print(name, f"{found.difference:.1f}", flush=True)
            return found

        rows = [row("none", without)]
        for which, brick in chosen_bricks(subject).items():
            rows += [row(f"{name}, {which}", defect(subject, brick)) for name, defect in OF_A_BRICK.items()]
        rows += [row(name, defect(subject)) for name, defect in OF_ALL.items() if name != WRONG_LIGHT or scene.shading]
    return rows


def staged(stage: Stage) -> Subject:
    """Return a subject with the bricks of its tolerance."""
    return Subject(stage, make_primitive(stage).make_lod(TOLERANCE, _stopwatch().lap))


def film(
    subject: Subject, change: Change = lambda draw_list: draw_list, frames: Sequence[int] = range(NUM_FRAMES)
) -> Film:
    """Draw frames, with a change of what is drawn."""
    with BrickRasterizer(num_threads=THREADS) as rasterizer:
        pictures = []
        for number in frames:
            draw_list = change(make_draw_list(subject.stage, subject.lod, number, _stopwatch()))
            pictures.append(draw_frame(subject.stage, draw_list, rasterizer, _stopwatch()).image)
    return pictures


def seen(prober: FrameProber, pictures: Film) -> Seen:
    """Probe all frames of a film."""
    frames = [prober.probe(number, picture).samples for number, picture in enumerate(pictures)]
    return Seen(frames, pool_samples(frames))


def chosen_bricks(subject: Subject) -> dict[str, int]:
    """Return the brick whose absence changes most, of some drawn by lot, and the median one; all have a parent."""
    order = subject.lod.orders(make_draw_list(subject.stage, subject.lod, 0, _stopwatch()).view)[0][1][0]
    order = order[subject.batch.cut.levels[order] < len(subject.batch.bricks.levels) - 1]
    candidates = np.random.default_rng(0).permutation(order)[:CANDIDATES]
    whole = film(subject, frames=TRIAL_FRAMES)
    changes = [_difference(whole, _missing(subject, brick, TRIAL_FRAMES)) for brick in candidates.tolist()]
    ranked = candidates[np.argsort(changes)]
    return {"the most important brick": int(ranked[0]), "a typical brick": int(ranked[len(ranked) // 2])}


# Defects of a brick


def _missing(subject: Subject, brick: int, frames: Sequence[int] = range(NUM_FRAMES)) -> Film:
    return film(subject, lambda draw_list: _in_order(draw_list, lambda order: order[order != brick]), frames)


def _drawn_last(subject: Subject, brick: int) -> Film:
    """Draw a brick behind all others."""

    def late(order: UInt32) -> UInt32:
        return np.ascontiguousarray(order[np.argsort(order == brick, kind="stable")])

    return film(subject, lambda draw_list: _in_order(draw_list, late))


def _stale(subject: Subject, brick: int) -> Film:
    """Draw a brick with the texels of another one of its level, as if its slot had not been written."""
    cut = subject.batch.cut
    cell, alike = cut.cells[brick], np.flatnonzero(cut.levels == cut.levels[brick])
    other = cut.cells[np.random.default_rng(brick).choice(alike[alike != brick])]

    def exchanged(level: int, cells: Int32) -> Int32:
        is_hit = (cells == cell).all(axis=1) & (level == cut.levels[brick])
        return np.where(is_hit[:, None], other, cells)

    with _texels(before=exchanged):
        return film(subject)


def _of_parent(subject: Subject, brick: int) -> Film:
    """Draw, between the visible bounds of a brick, its parent's means."""
    cut = subject.batch.cut
    levels, cells = cut.levels.copy(), cut.cells.copy()
    levels[brick], cells[brick] = levels[brick] + 1, cells[brick] >> 1
    return film(subject, _of_batch(replace(subject.batch, cut=replace(cut, levels=levels, cells=cells))))


# Defects of all bricks


def _halo_off(subject: Subject) -> Film:
    """Give the halo the cells that lie one nearer to the middle."""

    def shifted(texels: Float32) -> Float32:
        texels = texels.copy()
        for axis in (1, 2, 3):
            along = np.moveaxis(texels, axis, 0)
            along[0], along[-1] = along[1], along[-2]
        return texels

    with _texels(after=shifted):
        return film(subject)


def _early(subject: Subject) -> Film:
    sampling = replace(subject.batch.screen_sampling, termination_transmittance=1 - EARLY_ALPHA)
    return film(subject, _of_batch(replace(subject.batch, screen_sampling=sampling)))


def _wrong_light(subject: Subject) -> Film:
    shading = subject.stage.scene.shading
    assert shading is not None
    x, y, z = shading.light
    return _restaged(subject, replace(subject.stage.scene, shading=replace(shading, light=(-x, -y, -z))))


def _transfer_shifted(subject: Subject) -> Film:
    low, high = subject.batch.bricks.layers[0].bricks.volume_range

    def shifted(*arguments: Any) -> TransferFunction:
        right = make_transfer_function(*arguments)
        return replace(right, values=right.values + (high - low) / 255)

    with patch("renderer.layers.layer.make_transfer_function", shifted):
        return _restaged(subject, subject.stage.scene)


def _restaged(subject: Subject, scene: Scene) -> Film:
    """Draw from another stage as the camera of this one sees it."""
    stage = subject.stage
    options: dict[str, Any] = {"clock": time.process_time, "num_threads": THREADS, "volumes": [stage.layers[0].volume]}
    with prepare_stage(scene, **options) as other:
        return film(staged(replace(other, target=stage.target, distance=stage.distance)))


def _in_order(draw_list: DrawList, change: Callable[[UInt32], UInt32]) -> DrawList:
    return replace(draw_list, orders=[(share, [change(order)]) for share, (order,) in draw_list.orders])


def _of_batch(batch: BrickBatch) -> Change:
    """Draw other bricks, in the order of the right ones."""
    return lambda draw_list: replace(draw_list, lod=replace(draw_list.lod, batches=[batch]))


@contextmanager
def _texels(
    before: Callable[[int, Int32], Int32] = lambda _, cells: cells,
    after: Callable[[Float32], Float32] = lambda texels: texels,
) -> Iterator[None]:
    """Change which cells' texels are made, by their level, and the texels."""

    def scalars(bricks: Bricks, cells: Int32, *, lit: bool) -> Float32:
        return after(scalar_texels(bricks, before(0, cells), lit=lit))

    def means(bricks: Bricks, level: int, cells: Int32, *cache: Any) -> Float32:
        return after(mean_texels(bricks, level, before(level, cells), *cache))

    with patch.multiple(brick_cache, scalar_texels=scalars, mean_texels=means):
        yield


def _difference(one: Film, other: Film) -> float:
    """Return the PSNR between two films, in 8 bits."""
    return psnr(float(np.mean([((a / 255 - b / 255) ** 2).mean() for a, b in zip(one, other, strict=True)])))


def _stopwatch() -> Stopwatch:
    return Stopwatch(time.process_time)


def section(name: str, rows: Sequence[Row]) -> Iterator[str]:
    """Yield the rows of a scene."""
    right = rows[0].seen
    yield f"## {name}"
    yield ""
    columns = " | ".join(f"PSNR by {num} rays a frame | film | frames of {NUM_FRAMES}" for num in RAYS)
    yield f"| defect | differ by, dB | {columns} |"
    yield "| --- " * (2 + 3 * len(RAYS)) + "|"
    for row in rows:
        cells = " | ".join(_cells(row.seen[num], right[num].film) for num in RAYS)
        yield f"| {row.name} | {row.difference:.1f} | {cells} |"
    yield ""
    for num in RAYS:
        missed = [
            f"{row.name} ({row.difference:.0f} dB)"
            for row in rows[1:]
            if not is_below(row.seen[num].film, right[num].film)
        ]
        yield f"Not noticed in the film at {num} rays: {'; '.join(missed) or 'nothing'}."
        yield ""


def _cells(found: Seen, right: ErrorSamples) -> str:
    low, high = found.film.interval
    noticed = "yes" if is_below(found.film, right) else "no"
    num_frames = sum(is_below(frame, right) for frame in found.frames)
    return f"{psnr(found.film.mean):.1f} ({psnr(high):.1f} to {psnr(low):.1f}) | {noticed} | {num_frames}"


def is_below(one: ErrorSamples, other: ErrorSamples) -> bool:
    """Return whether one interval of PSNR lies wholly below the other."""
    return one.interval[0] > other.interval[1]


WRONG_LIGHT = "light from the opposite side"
OF_A_BRICK = {
    "missing": _missing,
    "texels of another brick": _stale,
    "means of its parent": _of_parent,
    "drawn last": _drawn_last,
}
OF_ALL = {
    "halo off by one cell": _halo_off,
    f"rays end at alpha {EARLY_ALPHA:g}": _early,
    WRONG_LIGHT: _wrong_light,
    "transfer function off by a level of 8 bits": _transfer_shifted,
}
# By name: the file, and whether it is lit.
SCENES: dict[str, tuple[Path, bool]] = {
    "Engine, CT, not lit": (Path("engine.nhdr"), False),
    "Head, CT, lit": (Path("medical", "CT_pitch.nii.gz"), True),
}


if __name__ == "__main__":
    main()
