"""Measure modes and light against VTK: `python tests/bench/peers_modes.py DATA` writes docs/benchmarks/peers_modes.md.

Each scene is measured by `hsplat measure --peer vtk` several times, in turns with the others. Times are medians of
these rounds. `--studies FOLDER` keeps the reports, and uses those that are there already.
"""

from __future__ import annotations

import json
import statistics
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import yaml
from measuring import PAGES, Point, fastest, machine_line, parser_of
from modes import scene_of
from peers import points, shown

import renderer
from hsplat_cli.main import run
from renderer.scene import scene_to_dict

PAGE = PAGES / "peers_modes.md"
SIZE, FRAME, ROUNDS, GOALS = (512, 512), 5, 3, (40.0, 45.0, 50.0)
VOLUMES = {"engine": "engine.nhdr", "bonsai": "bonsai.nhdr", "abdomen": "medical/CT_pitch.nii.gz"}
LIGHT = {"light": "camera", "ambient": 0.3, "diffuse": 0.7, "specular": 0.2, "shininess": 32}
MODES = ("maximum", "minimum", "mean", "light")
TOLERANCES = "1,0.5,0.3,0.2,0.15,0.12,0.1,0.07,0.05,0.03,0.02,0.01,0.003,0"
OPTIONS = (
    "--tolerances", TOLERANCES, "--footprints", "integrated", "--measures", "optical", "--corrections", "on",
    "--frames", f"{FRAME}:{FRAME + 1}", "--truth-tolerance", "1e-4", "--peer", "vtk", "--repeats", "3", "--quiet",
)  # fmt: skip

HEAD = """# Modes and light against VTK

Footprint: integrated. Measure again when a mode, light at samples or the drawing of bricks changes, and with a new
version of VTK.

`python tests/bench/peers_modes.py DATA` writes this page: milliseconds of frame {frame} of a turntable, {width} x
{height}, for the fastest setting that reaches an accuracy against the exact rays, of hsplat and of any of VTK's
mappers. Projections have grays from the smallest scalar to the largest; light is that of the camera ({light}) on the
suggested scene. Times are medians of {rounds} rounds, in each of which every setting draws 3 frames, hsplat's first and
then VTK's. *Noise* is the longest time of a setting over its shortest, the median of all settings of each program.

Both draw the same: of a maximum, a border of the lowest value over the colour of that; of a minimum and a mean, what
lies between the centres of the outer voxels, where hsplat cuts the volume, which costs it time; in light, a transparent
border. VTK's mean is drawn by its GPU mapper alone. *Best* is what its finest setting reaches. What is left are frames
of 8 bits (about 59 dB), steps of half a voxel, tables, and in light Phong's highlights in place of Blinn's. The
fixed-point mapper, besides, blends the edges of the box, and shades voxels and interpolates their light.

{machine}
"""


def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("--studies", type=Path)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.studies or Path(temporary)
        names = [(volume, mode) for volume in VOLUMES for mode in MODES]
        rounds = [
            [study_of(arguments.data, *name, folder / "-".join([*name, str(k)])) for name in names]
            for k in range(ROUNDS)
        ]
        lines = HEAD.format(
            frame=FRAME, width=SIZE[0], height=SIZE[1], rounds=ROUNDS, machine=machine_line(),
            light=", ".join(f"{key} {value}" for key, value in LIGHT.items() if key != "light"),
        )  # fmt: skip
        studies = dict(zip(names, zip(*rounds, strict=True), strict=True))
        for volume in VOLUMES:
            lines += f"\n## {volume}\n\n| mode | accuracy | hsplat | tolerance | VTK | VTK's setting | hsplat / VTK "
            lines += "| noise | best: gpu, fixed point |\n|---|---|---|---|---|---|---|---|---|\n"
            lines += "".join(row + "\n" for mode in MODES for row in rows(mode, studies[volume, mode]))
        PAGE.write_text(lines, encoding="utf-8")


def study_of(data: Path, volume: str, mode: str, folder: Path) -> dict[str, Any]:
    """Return the JSON of a study, measured now unless it is there."""
    path = folder / "measure.json"
    if not path.exists():
        folder.mkdir(parents=True, exist_ok=True)
        scene = folder / "scene.yaml"
        scene.write_text(yaml.safe_dump(tree_of(data, VOLUMES[volume], mode)), encoding="utf-8")
        assert run(["measure", str(scene), "--output", str(folder), *OPTIONS]) == 0
        print(folder.name, flush=True)
    study: dict[str, Any] = json.loads(path.read_text("utf-8"))
    return study


def tree_of(data: Path, volume: str, mode: str) -> dict[str, Any]:
    """Return the turntable of a volume in a mode, or as suggested in the light of the camera."""
    if mode != "light":
        return scene_to_dict(scene_of(data, volume, mode))
    tree = scene_to_dict(renderer.suggest_scene((data / volume).resolve(), size=SIZE))
    return tree | {"shading": LIGHT}


def rows(mode: str, rounds: Sequence[dict[str, Any]]) -> Iterator[str]:
    """Return the rows of a mode."""
    (own, own_noise), (peer, peer_noise) = (
        medians([points(each, tool) for each in rounds]) for tool in ("hsplat", "vtk")
    )
    best = ", ".join(
        f"{max(found):.1f} dB"
        if (found := [point.psnr for point in peer if point.setting.startswith(mapper)])
        else "none"
        for mapper in ("gpu", "fixed point")
    )
    for psnr in GOALS:
        mine, theirs = fastest(own, psnr), fastest(peer, psnr)
        ratio = f"{mine.ms / theirs.ms:.2f}" if mine and theirs else ""
        yield (
            f"| {mode} | {psnr:.0f} dB | {shown(mine)} | {mine.setting.removeprefix('tolerance ') if mine else ''} "
            f"| {shown(theirs)} | {theirs.setting if theirs else ''} | {ratio} "
            f"| {own_noise:.2f}, {peer_noise:.2f} | {best} |"
        )


def medians(rounds: Sequence[Sequence[Point]]) -> tuple[list[Point], float]:
    """Return the settings with their median times, and the median of the largest time of each over its smallest."""
    settings = [[point.ms for point in same] for same in zip(*rounds, strict=True)]
    found = [point._replace(ms=statistics.median(ms)) for point, ms in zip(rounds[0], settings, strict=True)]
    return found, statistics.median(max(ms) / min(ms) for ms in settings)


if __name__ == "__main__":
    main()
