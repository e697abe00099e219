"""Measure how far golden frames of bricks are from exact pictures, in which a pixel is the mean over its area.

`python tests/golden/errors.py` prints the PSNR of each golden frame; docs/benchmarks/goldens.md sums it up.
Transparent frames are compared over black. Pixels under an annotation are left out. Frames with the lines of the octree
are not measured: their lines cover them.
"""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

FOLDER = Path(__file__).resolve().parent
sys.path[:0] = [str(FOLDER), str(FOLDER.parents[1])]

from golden_cases import CASES, SCENE, Case  # noqa: E402

from hsplat_cli.scenes import SceneRequest, load_job  # noqa: E402
from renderer.accuracy import TRUTH_TOLERANCE, compute_metric, compute_truth  # noqa: E402
from renderer.film import Picture, over_black  # noqa: E402
from renderer.frame import FilmAnnotation, FilmStage, prepare_stage  # noqa: E402
from renderer.scene import FilmScene  # noqa: E402
from renderer.system import num_cores  # noqa: E402
from renderer.truth import PixelMeans  # noqa: E402


def main() -> None:
    print("| case | frame | PSNR, dB |")
    print("|---|---|---|")
    for case in CASES:
        with tempfile.TemporaryDirectory() as scratch:
            for number, decibels in measured(case, scene_of(case, Path(scratch))):
                print(f"| {case} | {number} | {decibels:.1f} |", flush=True)


def scene_of(case: Case, scratch: Path) -> FilmScene:
    """Return the scene of a case, with nothing left open. scratch: a folder for files."""
    volume = None if case.volume is None else case.volume(scratch)
    return load_job(SceneRequest(SCENE, case.changes, volume), "nothing").scene


def measured(case: Case, scene: FilmScene) -> Iterator[tuple[int, float]]:
    """Yield the number of each golden of a scene, and its PSNR in decibels."""
    if scene.needs_opengl or scene.at(0).annotation.octree:
        return
    with prepare_stage(scene, clock=time.perf_counter, num_threads=num_cores()) as stage:
        for golden in json.loads((case.folder / "golden.json").read_bytes())["frames"]:
            number = golden["frame"]
            yield number, psnr_of(case.folder / golden["pictures"][0]["file"], open_means(stage, number))


def open_means(stage: FilmStage, frame: int) -> PixelMeans:
    """Return the exact means of the pixels of a frame; those under its annotation are NaN."""
    covered = FilmAnnotation(stage).covered(frame, None)
    means = compute_truth(stage, frame, TRUTH_TOLERANCE, num_threads=num_cores()).means
    if covered is not None:
        means.colors[covered] = np.nan
    return means


def psnr_of(file: Path, means: PixelMeans) -> float:
    """Return the PSNR of a picture in decibels, over the pixels whose means are not NaN."""
    picture = over_black(Picture(file=file).pixels)[..., :3]
    is_open = ~np.isnan(means.colors[..., 0])
    # The metric takes pictures of three axes: the open pixels are one column.
    open_picture, *open_means = (each[is_open][:, None] for each in (picture, *means))
    return compute_metric("psnr", open_picture, PixelMeans(*open_means))


if __name__ == "__main__":
    main()
