"""Measure frames against VTK: `python tests/bench/peers.py DATA` writes docs/benchmarks/peers.md.

Measures every scene of tests/bench/scenes, with its volume from the folder DATA, by `hsplat measure --peer vtk`, in one
process each, one after the other: what a frame of some accuracy takes, as the fastest setting that reaches it.
`--studies FOLDER` keeps the reports, and uses those that are there already.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from measuring import PAGES, SCENES, Point, fastest, parser_of, write_page

from hsplat_cli.main import run

PAGE = PAGES / "peers.md"

OPTIONS = (
    "--footprints", "integrated", "--measures", "optical", "--corrections", "on", "--peer", "vtk", "--repeats", "7",
    "--quiet",
)  # fmt: skip
TOLERANCES = (
    "6,4,3,2,1.6,1.3,1,0.8,0.7,0.6,0.5,0.4,0.3,0.25,0.2,0.17,0.15,0.12,0.1,0.07,0.05,0.03,0.02,0.01,0.003,0.001,0"
)
# Accuracies, dB, and the part of VTK's time that a frame may take.
GOALS = ((30.0, 1 / 3), (35.0, 1 / 4), (40.0, 1 / 5), (45.0, 1 / 8))
GOAL_AT_BEST = 1 / 10


def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("--studies", type=Path)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        studies = {
            scene.stem: study_of(scene, arguments.data, (arguments.studies or Path(folder)) / scene.stem)
            for scene in sorted(SCENES.glob("*.yaml"))
        }
    write_page(PAGE, page(studies))


def study_of(scene: Path, data: Path, folder: Path) -> dict[str, Any]:
    """The JSON of a study, measured now unless it is there; its volume has the scene's name up to the first _."""
    path = folder / "measure.json"
    if not path.exists():
        volume = data / f"{scene.stem.partition('_')[0]}.nhdr"
        arguments = ["measure", str(scene), "--thorough", "--output", str(folder), "--volume", str(volume)]
        assert run([*arguments, "--frames", "0:1", "--tolerances", TOLERANCES, *OPTIONS]) == 0
    study: dict[str, Any] = json.loads(path.read_text("utf-8"))
    return study


def page(studies: Mapping[str, dict[str, Any]]) -> Iterator[str]:
    """The lines of the page."""
    machine = next(iter(studies.values()))["machine"]
    yield "{processor}, {device}, commit {commit}".format(**machine)
    for name, study in studies.items():
        yield from section(name, study)


def section(name: str, study: dict[str, Any]) -> Iterator[str]:
    """One scene."""
    own, peer = points(study, "hsplat"), points(study, "vtk")
    yield from ("", f"## {name}", "")
    yield "| accuracy | hsplat | tolerance | VTK | VTK's setting | hsplat / VTK | goal |"
    yield "| --- " * 7 + "|"
    best = max(point.psnr for point in peer)
    for psnr, goal in (*GOALS, (best, GOAL_AT_BEST)):
        mine, theirs = fastest(own, psnr), fastest(peer, psnr)
        ratio = f"{mine.ms / theirs.ms:.2f}" if mine and theirs else ""
        yield (
            f"| {psnr:.1f} dB | {shown(mine)} | {mine.setting.removeprefix('tolerance ') if mine else ''} "
            f"| {shown(theirs)} | {theirs.setting if theirs else ''} | {ratio} | {goal:.2f} |"
        )
    yield from ("", "| tolerance | PSNR, dB | ms |", "| --- | --- | --- |")
    for point in own:
        yield f"| {point.setting.removeprefix('tolerance ')} | {point.psnr:.1f} | {point.ms:.1f} |"


def points(study: dict[str, Any], tool: str) -> list[Point]:
    """All settings of a program."""
    return [
        Point(
            each["label"] if tool == "hsplat" else f"{each['series'].removeprefix('vtk ')}, {each['label']}",
            each["overall"]["everywhere"]["psnr"],
            1e3 * each["frame_seconds"]["median"],
        )
        for each in study["measurements"]
        if each["options"]["tool"] == tool
    ]


def shown(point: Point | None) -> str:
    return f"{point.ms:.1f} ms" if point else "not reached"


if __name__ == "__main__":
    main()
