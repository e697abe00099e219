"""What do suggested scenes look like? `python tests/bench/looks.py DATA [VOLUME ...]` writes the page of it.

Other volumes than those of DATA are drawn if they are named. The page is docs/benchmarks/looks.md, its pictures are
beside it. What is still wrong was seen by eye and stands below.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import imageio.v3 as iio
import numpy as np
from measuring import PAGES, machine_line

import renderer
from renderer.readers import read_volume
from renderer.suggest import compute_statistics, suggest
from renderer.volume import UInt8

PAGE = PAGES / "looks.md"
SIZE, FRAMES, ROWS_PER_PICTURE = (200, 200), (10, 45, 85), 8
# What was seen, by volume; the others are what they should be.
SEEN = {
    "engine": "the far side is veiled",
    "bonsai": "a little of the holder is left, beside the pot",
    "hydrogen atom": "the innermost of four levels is hardly seen",
    "walnut": "a shred of the holder is left",
    "LIDC2, CT": "veins and lungs in one colour",
    "CT_pitch": "the head rest is as thick as the jaw, and is left",
    "headsq_quarter, CT": "upside down, as its header has it",
    "t1_dicom_part": "a part of a head, open on two sides: little to recognise",
    "example4d": "a slab of a head, open above",
    "functional": "21 voxels and fewer along each axis",
    "ct_aorta": "blood with a contrast agent is as white as bone; wires in front",
    "ct_dicom": "20 slices; the ends of the table, between the arms, are left",
    "mr_body_sm": "20 slices; organs in two colours",
    "dx_mri": "16 slices; a line at the edge of the image is left",
    "stardist_img": "noisy surfaces; nuclei that touch run together",
    "frog_tissues": "the skeleton, one label, is over all others",
    "xray_1jzv": "a density that fills the crystal: no molecule stands out",
}
NOTES = (
    "The volumes from ct_abdomen on were found when all this was written, among 40 that other packages come with. One",
    "pass of ratings by eye, from 0 (throw away) to 3 (show it to a colleague), had 2.1 for the pictures of hsplat as",
    "they came, and 1.1 for PyVista's and 1.0 for F3D's defaults, and 0.85 for the preset that 3D Slicer takes by the",
    "width of the values, drawn by hsplat. What was wrong was mended then: slabs whose object fills most of their",
    "border, heads of two materials, holders that touch the object, weak lobes of orbitals, labels of a few voxels,",
    "noise without a background. The pictures are those of now.",
)
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


def draw(path: Path) -> tuple[renderer.Scene, Pixels, float]:
    """Return the suggested scene, its pictures side by side, and the seconds that the suggestion took."""
    volume, options = source(path)
    start = time.perf_counter()
    scene = renderer.suggest_scene(volume, size=SIZE, **options)
    seconds = time.perf_counter() - start
    return (
        scene,
        np.concatenate([np.asarray(renderer.render_frame(scene, k))[..., :3] for k in FRAMES], axis=1),
        seconds,
    )


def agreement(scene: renderer.Scene) -> str:
    """Return the part of the picture that is as asked for, from 0 to 1; nothing without targets."""
    volume = read_volume(scene.volume)
    shown = suggest(volume, compute_statistics(volume.values, volume.source)).visible
    return f"{sum(min(each.share, each.target) for each in shown):.2f}" if shown else ""


def rows(volumes: dict[str, Path]) -> Iterator[tuple[str, Pixels]]:
    """Yield a line of the table and a row of pictures for each volume."""
    for name, path in volumes.items():
        print(name, flush=True)
        scene, pictures, seconds = draw(path)
        cells = (name, agreement(scene), f"{seconds:.1f}", len(scene.clip) or "", SEEN.get(name, ""))
        yield f"| {' | '.join(map(str, cells))} |", pictures


def page(volumes: dict[str, Path]) -> None:
    """Write the page and its pictures."""
    found = list(rows(volumes))
    lines = [
        "# What suggested scenes look like",
        "",
        "Three frames of a turntable, in the order of the table. *As asked for* is the part of the picture that each",
        "material, or level, was meant to have and has, over the whole turn. *s* is the time of the suggestion,",
        "reading included; *clip* are planes that clip away what is not the object. The last column says what is still",
        "wrong, seen by eye.",
        "",
        *NOTES,
        "",
    ]
    for k in range(0, len(found), ROWS_PER_PICTURE):
        part = found[k : k + ROWS_PER_PICTURE]
        name = f"looks_{k // ROWS_PER_PICTURE + 1}.jpg"
        iio.imwrite(PAGES / name, np.concatenate([picture for _, picture in part]), quality=85)
        lines += [
            "| volume | as asked for | s | clip | still wrong |",
            "|---|---|---|---|---|",
            *(line for line, _ in part),
            "",
            f"![these volumes]({name})",
            "",
        ]
    lines += [machine_line(), "", f"Written by `tests/bench/{Path(__file__).name}`."]
    PAGE.write_text("\n".join(lines) + "\n", encoding="utf-8")


def main() -> None:
    """Write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    parser.add_argument("volumes", type=Path, nargs="*")
    given = parser.parse_args()
    volumes = {name: given.data / path for name, path in VOLUMES.items()}
    volumes |= {path.name.partition(".")[0]: path for path in given.volumes}
    page(volumes)


if __name__ == "__main__":
    main()
