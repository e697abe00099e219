"""What do suggested scenes look like? `python tests/bench/looks.py DATA [VOLUME ...]` writes the page of it.

Other volumes than those of DATA are drawn if they are named. The page is docs/benchmarks/looks.md, its pictures are
beside it. What is still wrong was seen by eye, and stands on the page above the figures.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import imageio.v3 as iio
import numpy as np
from measuring import PAGES, machine_line, parser_of, write_page

import renderer
from renderer.readers import read_volume
from renderer.scene import Scene
from renderer.statistics import compute_statistics
from renderer.suggest import suggest
from renderer.volume import UInt8

PAGE = PAGES / "looks.md"
SIZE, FRAMES, ROWS_PER_PICTURE = (200, 200), (10, 45, 85), 8
VOLUMES = {
    "engine": "engine.nhdr", "bonsai": "bonsai.nhdr", "fuel": "fuel.nhdr", "neghip": "neghip.nhdr",
    "hydrogen atom": "hydrogenAtom.nhdr", "Marschner-Lobb": "marschnerlobb.nhdr", "walnut": "walnut.raw",
    "LIDC2, CT": "medical/LIDC2.mha", "CT_pitch": "medical/CT_pitch.nii.gz",
    "headsq_quarter, CT": "medical/headsq_quarter.nrrd", "t1_dicom_part": "medical/t1_dicom_part",
    "seg3d_MR": "medical/seg3d_MR.nii.gz", "chris_PD": "medical/chris_PD.nii.gz",
    "CIT168_T1w": "medical/CIT168_T1w.nii.gz", "CIT168_labels": "medical/CIT168_labels.nii.gz",
    "PD25_T1": "medical/PD25_T1.nii.gz", "PD25_labels": "medical/PD25_labels.nii.gz",
    "example4d": "medical/example4d.nii.gz", "functional": "medical/functional.nii",
    "benzene, orbital": "simulation/benzene-homo.cube",
}  # fmt: skip
Pixels = UInt8


def source(path: Path) -> Any:
    """Return what `suggest_scene` takes, and its options."""
    if path.name != "walnut.raw":
        return str(path), {}
    return np.fromfile(path, "<u2").reshape(114, 96, 128), {"spacing": (0.015625,) * 3}


def draw(path: Path) -> tuple[renderer.FilmScene, Pixels, float]:
    """Return the suggested scene, its pictures side by side, and the seconds that the suggestion took."""
    volume, options = source(path)
    start = time.perf_counter()
    scene = renderer.suggest_scene(volume, size=SIZE, **options)
    seconds = time.perf_counter() - start
    pictures = [np.asarray(renderer.render_frame(scene, k))[..., :3] for k in FRAMES]
    return scene, np.concatenate(pictures, axis=1), seconds


def agreement(scene: Scene) -> str:
    """Return the part of the picture that is as asked for, from 0 to 1; nothing without targets."""
    volume = read_volume(scene.layers[0].volume)
    shown = suggest(volume, compute_statistics(volume.values, volume.source)).visible
    return f"{sum(min(each.share, each.target) for each in shown):.2f}" if shown else ""


def rows(volumes: dict[str, Path]) -> Iterator[tuple[str, Pixels]]:
    """Yield a line of the table and a row of pictures for each volume."""
    for name, path in volumes.items():
        print(name, flush=True)
        scene, pictures, seconds = draw(path)
        first = scene.at(0)
        cells = (name, agreement(first), f"{seconds:.1f}", len(first.clip) or "")
        yield f"| {' | '.join(map(str, cells))} |", pictures


def page(volumes: dict[str, Path]) -> None:
    """Write the page and its pictures."""
    found = list(rows(volumes))
    lines = [machine_line(), ""]
    for k in range(0, len(found), ROWS_PER_PICTURE):
        part = found[k : k + ROWS_PER_PICTURE]
        name = f"looks_{k // ROWS_PER_PICTURE + 1}.jpg"
        PAGES.mkdir(parents=True, exist_ok=True)
        iio.imwrite(PAGES / name, np.concatenate([picture for _, picture in part]), quality=85)
        lines += ["| volume | as asked for | s | clip |", "|---|---|---|---|", *(line for line, _ in part)]
        lines += ["", f"![these volumes]({name})", ""]
    write_page(PAGE, lines)


def main() -> None:
    """Write the page."""
    parser = parser_of(__doc__)
    parser.add_argument("volumes", type=Path, nargs="*")
    given = parser.parse_args()
    volumes = {name: given.data / path for name, path in VOLUMES.items()}
    volumes |= {path.name.partition(".")[0]: path for path in given.volumes}
    page(volumes)


if __name__ == "__main__":
    main()
