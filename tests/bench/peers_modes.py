"""Measure modes and light against VTK: `python tests/bench/peers_modes.py DATA` writes build/benchmarks/peers_modes.md.

Every setting of both programs is drawn once for its accuracy. Of each program the fastest settings that reach the
wanted accuracies are then timed in turns.
"""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from against_vtk import Compared, compared, own_point, peer_point, shown
from measuring import PAGES, Point, fastest, machine_line, parser_of, write_page
from modes import LOOKS, tree_of
from vtk_peer import VtkSetting, comparable, describe_vtk, vtk_settings

from renderer.readers import read_volume
from renderer.scene import Scene, parse_scene
from renderer.volume import Volume, make_volume

PAGE = PAGES / "peers_modes.md"
FRAME = 5
ROUNDS = 3
GOALS = (40.0, 45.0, 50.0)  # dB
TOLERANCES = (1.0, 0.5, 0.3, 0.2, 0.15, 0.12, 0.1, 0.07, 0.05, 0.03, 0.01, 0.0)
VOLUMES = {"engine": "engine.nhdr", "bonsai": "bonsai.nhdr", "head": "medical/CT_pitch.nii.gz"}
LIGHT = {"light": "camera", "ambient": 0.3, "diffuse": 0.7, "specular": 0.2, "shininess": 32}
MODES = ("maximum", "minimum", "mean", "light")
COLUMNS = "volume | mode | accuracy | hsplat | tolerance | VTK | VTK's setting | hsplat / VTK | noise | best"


def main() -> None:
    data = parser_of(__doc__).parse_args().data
    lines = [f"{machine_line()} VTK {describe_vtk()['version']}.", "", f"| {COLUMNS} |", "|---" * 10 + "|"]
    for name, file in VOLUMES.items():
        for mode in MODES:
            for row in rows(lit_scene(data / file) if mode == "light" else projected_scene(data, file, mode)):
                lines.append(f"| {name} | {mode} {row}")
                print(lines[-1], flush=True)
                write_page(PAGE, lines)


def projected_scene(data: Path, file: str, mode: str) -> Scene:
    """Return the turntable in a mode."""
    tree = tree_of(data, file)
    volume = read_volume(parse_scene(tree, base=Path("/")).layers[0].volume)
    return parse_scene(tree | LOOKS[mode](volume), base=Path("/"))


def lit_scene(volume: Path) -> Scene:
    """Return the suggested turntable in the light of the camera, without clipping, which VTK does not draw."""
    return parse_scene(tree_of(Path("/"), str(volume.resolve())) | {"shading": LIGHT}, base=Path("/"))


def rows(scene: Scene) -> Iterator[str]:
    """Measure a scene, and return a row for each accuracy."""
    volume = read_volume(scene.layers[0].volume)
    if scene.mode.type == "minimum":
        scene, volume = replace(scene, output=replace(scene.output, background=(1.0, 1.0, 1.0))), negative(volume)
    scene, volume, _ = comparable(scene, volume)
    with compared(scene, volume, [FRAME]) as both:
        peers = {each.name: each for each in vtk_settings(scene.mode)}
        own = [own_point(both.own(tolerance, 2)) for tolerance in TOLERANCES]
        peer = [peer_point(each) for each in both.peer(list(peers.values()), 1)]
        best = max(found.psnr for found in peer)
        pairs = [(fastest(own, psnr), fastest(peer, psnr)) for psnr in GOALS]
        mine, theirs = ({found.setting for found in column if found} for column in zip(*pairs, strict=True))
        turns = [turn(both, mine, {name: peers[name] for name in theirs}) for _ in range(ROUNDS)]
    for psnr, pair in zip(GOALS, pairs, strict=True):
        (one, own_noise), (other, peer_noise) = (timed(setting, turns) for setting in pair)
        ratio = f"{one.ms / other.ms:.2f}" if one and other else ""
        yield (
            f"| {psnr:.0f} dB | {shown(one)} | {one.setting if one else ''} | {shown(other)} "
            f"| {other.setting if other else ''} | {ratio} | {own_noise}, {peer_noise} "
            f"| {best:.1f} dB |"
        )


def negative(volume: Volume) -> Volume:
    """Return a volume with its lowest value where its highest was, and so on."""
    low, high = volume.value_range()
    values = (low + high - volume.values.astype(np.float64)).astype(volume.values.dtype)
    return make_volume(values, volume.world_from_index, f"negative of {volume.name}")


def turn(both: Compared, mine: set[str], theirs: dict[str, VtkSetting]) -> dict[str, float]:
    """Return the milliseconds of settings of both programs, one program after the other."""
    times = {name: both.own(float(name), 5).frame_seconds * 1e3 for name in mine}
    found = both.peer(list(theirs.values()), 2)
    return times | {name: each.frame_seconds * 1e3 for name, each in zip(theirs, found, strict=True)}


def timed(setting: Point | None, turns: Sequence[dict[str, float]]) -> tuple[Point | None, str]:
    """Return a setting with its median time, and how far its rounds are apart."""
    if setting is None:
        return None, "-"
    times = [each[setting.setting] for each in turns]
    return setting._replace(ms=statistics.median(times)), f"{max(times) / min(times):.2f}"


if __name__ == "__main__":
    main()
