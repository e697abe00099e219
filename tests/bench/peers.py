"""Measure frames against VTK: `python tests/bench/peers.py DATA` writes build/benchmarks/peers.md.

Measures a frame of every scene of tests/bench/scenes, with its volume from the folder DATA: how long a frame of some
accuracy takes, at the fastest setting that reaches it.
"""

from __future__ import annotations

from collections.abc import Iterator

from against_vtk import FASTEST_COLUMNS, compared, fastest_row, own_point, peer_point
from measuring import PAGES, SCENES, machine_line, parser_of, write_page
from vtk_peer import check_vtk, comparable, describe_vtk, vtk_settings

from renderer.readers import read_volume
from renderer.scene import Scene, load_scene

PAGE = PAGES / "peers.md"

REPEATS = 7
TOLERANCES = (
    *(6, 4, 3, 2, 1.6, 1.3, 1, 0.8, 0.7, 0.6, 0.5, 0.4, 0.3, 0.25, 0.2, 0.17, 0.15, 0.12, 0.1),
    *(0.07, 0.05, 0.03, 0.02, 0.01, 0.003, 0.001, 0),
)
# Accuracies, dB, and the part of VTK's time that a frame may take.
GOALS = ((30.0, 0.6), (35.0, 0.3), (40.0, 0.1), (45.0, 0.06))
# The same at the best accuracy that VTK has.
GOAL_AT_BEST = 0.05


def main() -> None:
    data = parser_of(__doc__).parse_args().data
    lines = [f"{machine_line()} VTK {describe_vtk()['version']}."]
    for path in sorted(SCENES.glob("*.yaml")):
        volume = data / f"{path.stem.partition('_')[0]}.nhdr"
        lines += section(path.stem, load_scene(path, volume=volume))
        write_page(PAGE, lines)


def section(name: str, scene: Scene) -> Iterator[str]:
    """Measure a scene, and yield the lines on it."""
    check_vtk(scene)
    scene, volume, _ = comparable(scene, read_volume(scene.layers[0].volume))
    with compared(scene, volume, [0]) as both:
        own = [own_point(both.own(tolerance, REPEATS)) for tolerance in TOLERANCES]
        peer = [peer_point(each) for each in both.peer(vtk_settings(scene.mode), REPEATS)]
    yield from ("", f"## {name}", "")
    yield f"| {' | '.join(FASTEST_COLUMNS)} | goal |"
    yield "| --- " * (len(FASTEST_COLUMNS) + 1) + "|"
    for psnr, goal in (*GOALS, (max(point.psnr for point in peer), GOAL_AT_BEST)):
        yield f"| {' | '.join(fastest_row(psnr, own, peer))} | {goal:.2f} |"
    yield from ("", "| tolerance | PSNR, dB | ms |", "| --- | --- | --- |")
    for point in own:
        yield f"| {point.setting} | {point.psnr:.1f} | {point.ms:.1f} |"


if __name__ == "__main__":
    main()
