"""Measure frames against VTK: `python tests/bench/peers.py DATA` writes build/benchmarks/peers.md.

Measures a frame of every scene of tests/bench/scenes, with its volume from the folder DATA, and of suggested turntables
without light: how long a frame of some accuracy takes, at the fastest setting that reaches it.
"""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from against_vtk import FASTEST_COLUMNS, compared, fastest_row, own_point, peer_point
from measuring import PAGES, SCENES, Point, fastest, machine_line, parser_of, suggested, write_page
from vtk_peer import check_vtk, comparable, describe_vtk, vtk_settings

from renderer.readers import read_volume
from renderer.scene import Scene, load_scene

PAGE = PAGES / "peers.md"

SIZE = (512, 512)
# Subjects whose suggested turntables are drawn, without the light and the clipping that VTK lacks.
SUGGESTED = ("head, CT, oblique", "head, proton density", "head, T1 atlas")
REPEATS = 7
TOLERANCES = (
    *(6, 4, 3, 2, 1.6, 1.3, 1, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.25, 0.2, 0.17, 0.15, 0.12, 0.1),
    *(0.07, 0.05, 0.03, 0.02, 0.01, 0.003, 0.001, 0),
)
# The part of VTK's time that a frame may take, by its accuracy in dB; None is the best that VTK has.
GOALS = {30.0: 0.6, 35.0: 0.3, 40.0: 0.1, 45.0: 0.06, None: 0.05}


def main() -> None:
    data = parser_of(__doc__).parse_args().data
    lines = [f"{machine_line()} VTK {describe_vtk()['version']}."]
    results = {}
    for name, scene in scenes(data):
        results[name] = measured(scene)
        lines += section(name, *results[name])
        write_page(PAGE, [*lines, *summary(results)])


def scenes(data: Path) -> Iterator[tuple[str, Scene]]:
    """Yield the name of each scene with the scene."""
    for path in sorted(SCENES.glob("*.yaml")):
        volume = data / f"{path.stem.partition('_')[0]}.nhdr"
        yield path.stem, load_scene(path, volume=volume)
    for name in SUGGESTED:
        yield name, replace(suggested(data, name, SIZE).with_layers(shading=None), clip=())


def measured(scene: Scene) -> tuple[list[Point], list[Point]]:
    """Measure a scene, and return the settings of hsplat, and those of VTK."""
    check_vtk(scene)
    scene, volume, _ = comparable(scene, read_volume(scene.layers[0].volume))
    with compared(scene, volume, [0]) as both:
        own = [own_point(both.own(tolerance, REPEATS)) for tolerance in TOLERANCES]
        return own, [peer_point(each) for each in both.peer(vtk_settings(scene.mode), REPEATS)]


def section(name: str, own: Sequence[Point], peer: Sequence[Point]) -> Iterator[str]:
    """Yield the lines on a scene."""
    yield from ("", f"## {name}", "")
    yield f"| {' | '.join(FASTEST_COLUMNS)} | goal |"
    yield "| --- " * (len(FASTEST_COLUMNS) + 1) + "|"
    for psnr, goal in GOALS.items():
        yield f"| {' | '.join(fastest_row(psnr or best(peer), own, peer))} | {goal:.2f} |"
    for program, points in (("hsplat, tolerance", own), ("VTK", peer)):
        yield from ("", f"| {program} | PSNR, dB | ms |", "| --- | --- | --- |")
        for point in points:
            yield f"| {point.setting} | {point.psnr:.1f} | {point.ms:.1f} |"


def summary(results: Mapping[str, tuple[list[Point], list[Point]]]) -> Iterator[str]:
    """Yield the table of all scenes: milliseconds of hsplat / VTK, and medians where both reach the accuracy."""
    heads = [f"{psnr:.0f} dB" if psnr else "VTK's best" for psnr in GOALS]
    yield from ("", "## All scenes", "", f"| scene | {' | '.join(heads)} |", "|---" * (len(heads) + 1) + "|")
    for name, (own, peer) in results.items():
        yield f"| {name} | {' | '.join(times(psnr, own, peer) for psnr in GOALS)} |"
    medians = []
    for psnr in GOALS:
        ratios = [each for own, peer in results.values() if (each := ratio(psnr or best(peer), own, peer)) is not None]
        medians.append(f"{statistics.median(ratios):.2f}" if ratios else "")
    yield f"| ratio, median | {' | '.join(medians)} |"
    yield f"| goal of the project | {' | '.join(f'{goal:.2f}' for goal in GOALS.values())} |"


def times(psnr: float | None, own: Sequence[Point], peer: Sequence[Point]) -> str:
    """Return the milliseconds of both programs at an accuracy; None is the best that VTK has, which is named."""
    found = [fastest(points, psnr or best(peer)) for points in (own, peer)]
    text = " / ".join(f"{point.ms:,.1f}" if point else "not reached" for point in found)
    return text if psnr else f"{text} ({best(peer):.1f} dB)"


def best(peer: Sequence[Point]) -> float:
    """Return the best PSNR of VTK."""
    return max(point.psnr for point in peer)


def ratio(psnr: float, own: Sequence[Point], peer: Sequence[Point]) -> float | None:
    """Return the time of hsplat by that of VTK at an accuracy, or None if one of them does not reach it."""
    mine, theirs = fastest(own, psnr), fastest(peer, psnr)
    return mine.ms / theirs.ms if mine and theirs else None


if __name__ == "__main__":
    main()
