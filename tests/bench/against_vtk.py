"""Measure hsplat and VTK on one scene: `python tests/bench/against_vtk.py SCENE`.

Prints every setting of both programs with its time and accuracy, then, for each accuracy, the fastest settings that
reach it. Both draw the same volume, transfer function, mode, light and cameras: docs/benchmarks/peers_modes.md says
where they differ. The pages on VTK are written by `peers.py` and `peers_modes.py`, with what is here.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from measuring import THREADS, Point, fastest
from vtk_peer import VtkMeasurement, VtkSetting, check_vtk, comparable, describe_vtk, look_of, measure_vtk, vtk_settings

from hsplat_cli.measure import Measurement, measure_setting, plan_sweep
from hsplat_cli.reports import metric_text, ms_text
from hsplat_cli.terminal import describe_machine, format_table
from renderer.accuracy import METRICS, TRUTH_TOLERANCE, Accuracy, Truth, compute_truth, is_loop, spread_evenly
from renderer.draw import open_rasterizer
from renderer.frame import Stage, prepare_stage, view_of
from renderer.readers import read_volume
from renderer.scene import Scene, load_scene, with_tolerance
from renderer.volume import Volume

SHOWN_METRICS = ("psnr", "ssim", "flip", "delta_e_share")
# dB; beyond, pictures of 8 bits are no longer told apart.
ACCURACIES = (25.0, 30.0, 35.0, 40.0, 45.0, 50.0)
NUM_FRAMES = 3


class Compared(NamedTuple):
    """A scene that both programs draw, and its truths, each with the number of its frame."""

    stage: Stage
    truths: list[Truth]

    def own(self, tolerance: float, repeats: int) -> Measurement:
        """Measure hsplat at a tolerance."""
        stage = replace(self.stage, scene=with_tolerance(self.stage.scene, tolerance))
        with open_rasterizer(stage.scene) as rasterizer:
            return measure_setting(stage, self.truths, rasterizer, clock=time.perf_counter, repeats=repeats)

    def peer(self, settings: Sequence[VtkSetting], repeats: int) -> Iterator[VtkMeasurement]:
        """Measure settings of VTK."""
        volume, views = self.stage.layers[0].volume, [view_of(self.stage, truth.frame) for truth in self.truths]
        look = look_of(self.stage.scene, volume)
        return measure_vtk(volume, look, views, self.truths, settings=settings, repeats=repeats)


@contextmanager
def compared(scene: Scene, volume: Volume, frames: Sequence[int]) -> Iterator[Compared]:
    """Open a scene, made comparable, for both programs, and compute its truths."""
    options = {"clock": time.perf_counter, "num_threads": THREADS, "any_tolerance": True}
    with prepare_stage(scene, volumes=[volume], **options) as stage:
        truths = [compute_truth(stage, frame, TRUTH_TOLERANCE, num_threads=THREADS) for frame in frames]
        yield Compared(stage, truths)


def own_point(measured: Measurement) -> Point:
    """Return a setting of hsplat, named by its tolerance."""
    tolerance = f"{measured.setting.options['tolerance']:g}"
    return Point(tolerance, measured.overall.everywhere["psnr"], 1e3 * measured.frame_seconds)


def peer_point(measured: VtkMeasurement) -> Point:
    """Return a setting of VTK."""
    return Point(measured.setting.name, measured.overall.everywhere["psnr"], 1e3 * measured.frame_seconds)


def fastest_row(psnr: float, own: Sequence[Point], peer: Sequence[Point]) -> list[str]:
    """Return an accuracy, the fastest setting of hsplat that reaches it, that of VTK, and the ratio of their times."""
    mine, theirs = fastest(own, psnr), fastest(peer, psnr)
    ratio = f"{mine.ms / theirs.ms:.2f}" if mine and theirs else ""
    names = [point.setting if point else "" for point in (mine, theirs)]
    return [f"{psnr:.1f} dB", shown(mine), names[0], shown(theirs), names[1], ratio]


FASTEST_COLUMNS = ["accuracy", "hsplat", "tolerance", "VTK", "VTK's setting", "hsplat / VTK"]


def shown(point: Point | None) -> str:
    """Return the time of a setting."""
    return f"{point.ms:.1f} ms" if point else "not reached"


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("scene", type=Path)
    parser.add_argument("--volume", type=Path)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    parser.add_argument("--frames", type=int, nargs="+", help=f"by default {NUM_FRAMES} of the path")
    parser.add_argument("--repeats", type=int, default=3, help="timed passes, at most")
    arguments = parser.parse_args()
    scene = load_scene(arguments.scene, overrides=arguments.set, volume=arguments.volume)
    check_vtk(scene)
    vtk = describe_vtk()
    with open_rasterizer(scene) as rasterizer:
        print("{processor}, {device}, commit {commit};".format(**describe_machine(rasterizer.device)), end=" ")
    print("VTK {version}, {device}".format(**vtk))
    scene, volume, notes = comparable(scene, read_volume(scene.layers[0].volume))
    for note in notes:
        print("note:", note)
    camera = scene.camera
    numbers = spread_evenly(range(camera.num_frames), NUM_FRAMES, is_loop=is_loop(camera.path))
    with compared(scene, volume, arguments.frames or numbers) as both:
        for line in tables(both, arguments.repeats):
            print(line)


def tables(both: Compared, repeats: int) -> Iterator[str]:
    """Measure, and yield the tables."""
    stage = both.stage
    (plan,) = plan_sweep(stage.scene, lambda _: nullcontext(stage), [stage.scene.error], [stage.scene.splat], None)
    own = [both.own(planned.tolerance, repeats) for planned in plan]
    peer = list(both.peer(vtk_settings(stage.scene.mode), repeats))
    head = ["setting", "ms", *(METRICS[name].label for name in SHOWN_METRICS), "PSNR, volume"]
    rows = [_row(f"hsplat, {each.setting.label}", each.frame_seconds, each.overall) for each in own]
    rows += [_row(f"VTK {each.setting.name}", each.frame_seconds, each.overall) for each in peer]
    yield ""
    yield format_table([head, *rows], right_aligned=range(1, len(head)))
    yield ""
    points = [own_point(each) for each in own], [peer_point(each) for each in peer]
    yield format_table([FASTEST_COLUMNS, *(fastest_row(psnr, *points) for psnr in ACCURACIES)])


def _row(name: str, seconds: float, overall: Accuracy) -> list[str]:
    metrics = [metric_text(METRICS[metric], overall.everywhere[metric]) for metric in SHOWN_METRICS]
    return [name, ms_text(seconds), *metrics, metric_text(METRICS["psnr"], overall.on_volume["psnr"])]


if __name__ == "__main__":
    main()
