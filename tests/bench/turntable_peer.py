"""Measure whole films against PyVista.

`python tests/bench/turntable_peer.py DATA PYTHON` writes docs/benchmarks/turntables.md.

PYTHON is an interpreter that has pyvista, imageio and imageio-ffmpeg. Both programs make the same 120 frames of
512 x 512 as one MP4 from the same file, each by the fastest of its settings that comes to 40 dB, which is looked at
first: from the command to the film, in turn, several times.
"""

from __future__ import annotations

import json
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import imageio.v3 as iio
import numpy as np
from measuring import PAGES, SCENES, THREADS, machine_line, parser_of, render_command, timed

from hsplat_cli.studies.peers.vtk_peer import with_transparent_border
from renderer.accuracy import FloatImage, compute_truth
from renderer.frame import Stage, prepare_stage, view_of
from renderer.readers import read_volume
from renderer.scene import load_scene
from renderer.transfer import TransferFunction, make_transfer_function
from renderer.volume import Volume

PAGE = PAGES / "turntables.md"
PEER = Path(__file__).with_name("pyvista_turntable.py")

ACCURACY, GOAL = 40.0, 1 / 3
# hsplat's, from coarse to fine; and PyVista's from fast to slow, by what docs/benchmarks/peers.md says of their times.
TOLERANCES = (0.8, 0.6, 0.5, 0.4, 0.35, 0.3, 0.25, 0.2, 0.15, 0.1, 0.07, 0.05)
SETTINGS = (
    ("gpu", 3.0, 1), ("gpu", 2.5, 1), ("gpu", 2.0, 1), ("fixed_point", 1.0, 1), ("fixed_point", 0.85, 1),
    ("fixed_point", 0.7, 1), ("fixed_point", 0.6, 1), ("fixed_point", 0.5, 1), ("gpu", 1.0, 1), ("gpu", 0.5, 1),
)  # fmt: skip


def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("python", type=Path)
    parser.add_argument("--repeats", type=int, default=3)
    arguments = parser.parse_args()
    lines = [
        "# Whole films beside PyVista",
        "",
        "Footprint: `integrated`, the default. Measure again when anything on the way from the command to the MP4 "
        "changes: start, pyramid, drawing, workers, encoder.",
        "",
        "`python tests/bench/turntable_peer.py DATA PYTHON` writes this page. It times 120 frames of 512 x 512 that "
        f"the object fills, from the command to the MP4, with start-up; medians of {arguments.repeats} runs that take "
        f"turns. Each program has the fastest setting that reaches {ACCURACY:g} dB of the converged ray integral on "
        "the first frame, which has 8 bits. The outermost voxels are transparent because VTK's volumes end half a "
        "voxel earlier.",
        "",
        machine_line(),
        "",
        f"| scene | hsplat | wall | CPU | PyVista | wall | CPU | hsplat / PyVista, wall | CPU | goal {GOAL:.2f} |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for scene in sorted(SCENES.glob("*.yaml")):
        with tempfile.TemporaryDirectory() as folder:
            lines.append(row(scene, arguments.data, arguments.python, Path(folder), arguments.repeats))
            print(lines[-1], flush=True)
    PAGE.write_text("\n".join(lines) + "\n", encoding="utf-8")


def row(scene: Path, data: Path, python: Path, folder: Path, repeats: int) -> str:
    """One scene, with a volume whose outermost voxels are transparent."""
    spec = load_scene(scene, volume=data / f"{scene.stem.partition('_')[0]}.nhdr")
    read = read_volume(spec.volume)
    transfer = make_transfer_function(spec.transfer_function, read.finest_spacing)
    volume = with_transparent_border(read, transfer)
    file = write_nrrd(volume, folder / "volume.nrrd")
    stage = prepare_stage(spec, clock=time.perf_counter, num_threads=THREADS, volumes=[volume])
    truth = compute_truth(stage, 0, 1e-4).picture
    still, film = folder / "still.png", folder / "film.mp4"

    def own(tolerance: float, output: Path, *options: str) -> list[str]:
        return [*render_command(scene, file, output, [f"error.tolerance={tolerance}"]), *options]

    def peer(setting: tuple[str, float, int], output: Path) -> list[str]:
        job = folder / "job.json"
        job.write_text(json.dumps(job_of(stage, transfer, file, setting)), encoding="utf-8")
        return [str(python), str(PEER), str(job), str(output)]

    def own_still(tolerance: float) -> FloatImage:
        timed(own(tolerance, still, "--frames", "0"))
        return iio.imread(still)[..., :3] / 255

    def peer_still(setting: tuple[str, float, int]) -> FloatImage:
        timed(peer(setting, still.with_suffix(".npy")))
        return np.asarray(np.load(still.with_suffix(".npy"))[..., :3] / 255)

    tolerance, own_db = first_near(TOLERANCES, own_still, truth)
    setting, peer_db = first_near(SETTINGS, peer_still, truth)
    taken = [(timed(own(tolerance, film)), timed(peer(setting, film))) for _ in range(repeats)]
    (own_wall, own_cpu), (peer_wall, peer_cpu) = (
        [statistics.median(seconds) for seconds in zip(*one, strict=True)] for one in zip(*taken, strict=True)
    )
    wall, cpu = own_wall / peer_wall, own_cpu / peer_cpu
    mapper, step, _ = setting
    return (
        f"| {scene.stem} | {tolerance:g}, {own_db:.1f} dB | {own_wall:.1f} s | {own_cpu:.1f} s "
        f"| {mapper}, step {step:g}, {peer_db:.1f} dB | {peer_wall:.1f} s | {peer_cpu:.1f} s | {wall:.2f} | {cpu:.2f} "
        f"| {'met' if wall <= GOAL else 'not met'} |"
    )


def first_near(settings: Sequence[Any], still: Callable[[Any], FloatImage], truth: FloatImage) -> tuple[Any, float]:
    """The first setting whose picture is as near to the truth as is asked for, and how near it is, in dB."""
    for setting in settings:
        psnr = -10 * float(np.log10(np.mean((still(setting) - truth) ** 2)))
        print(f"{setting}: {psnr:.2f} dB", file=sys.stderr, flush=True)
        if psnr >= ACCURACY:
            return setting, psnr
    raise SystemExit(f"none of {settings} comes to {ACCURACY:g} dB")


def job_of(stage: Stage, transfer: TransferFunction, file: Path, setting: tuple[str, float, int]) -> dict[str, Any]:
    """What PyVista is to draw, in world units; opacities between so many points that it may be linear in them."""
    views = [view_of(stage, frame) for frame in range(stage.scene.camera.path.frames)]
    values = np.unique(np.concatenate([np.linspace(transfer.values[0], transfer.values[-1], 256), transfer.values]))
    colors, depths = transfer.classify(values)
    mapper, sample_distance, image_reduction = setting
    return {
        "volume": str(file),
        "points": np.column_stack([values, colors, -np.expm1(-depths)]).tolist(),
        "mapper": mapper,
        "sample_distance": sample_distance,
        "image_reduction": image_reduction,
        "size": stage.scene.output.size,
        "frames_per_second": stage.scene.output.frames_per_second,
        "angle_deg": stage.scene.camera.field_of_view,
        "cameras": [
            {"eye": view.eye.tolist(), "target": view.target.tolist(), "up": view.axes[1].tolist()} for view in views
        ],
    }


def write_nrrd(volume: Volume, path: Path) -> Path:
    """Voxels of 8 bits with a spacing of 1, which both programs read."""
    assert volume.values.dtype == np.uint8 and np.array_equal(volume.world_from_index, np.eye(4)), volume.name
    sizes = " ".join(map(str, volume.shape_xyz))
    header = f"NRRD0004\ntype: uint8\ndimension: 3\nsizes: {sizes}\nspacings: 1 1 1\nencoding: raw\n\n"
    path.write_bytes(header.encode() + volume.values.tobytes())
    return path


if __name__ == "__main__":
    main()
