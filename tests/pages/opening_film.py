"""Draw docs/opening.webp, the film of the README, from scenes of configs/: `python opening_film.py [FOLDER]`.

Frames are kept in FOLDER, if one is given, so that a film that was stopped resumes.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

from PIL import Image

from renderer import load_scene, render

ROOT = Path(__file__).resolve().parents[2]
FILM = ROOT / "docs" / "opening.webp"
# The scenes in their order; each is dissolved into the next one, and the last into the first.
SCENES = ("flower", "vessels", "storm", "organelles", "porous_rock")
# The frames of a scene, and how many of them are dissolved into the next scene.
NUM_FRAMES, NUM_DISSOLVED = 24, 4
SIZE = (480, 360)
# One background for all scenes, so that only the subject changes.
BACKGROUND = '{top: "#1d2c44", bottom: "#0a0f18"}'
# Milliseconds of a frame: 24 frames a second, in the whole milliseconds of WebP.
DURATION = 42
# The quality of the encoder, from 0 to 100.
QUALITY = 80


def draw(name: str, folder: Path) -> list[Image.Image]:
    """Draw the frames of a scene of configs/, and as many more as are dissolved into the next scene."""
    size = f"output.size=[{SIZE[0]}, {SIZE[1]}]"
    scene = load_scene(
        ROOT / "configs" / f"{name}.yaml", overrides=[size, f"output.background={BACKGROUND}", "error.probes=0"]
    )
    numbers = range(NUM_FRAMES + NUM_DISSOLVED)
    render(scene, output=folder / name / "{frame}.png", frames=slice(len(numbers)))
    files = sorted((folder / name).glob("*.png"), key=lambda file: int(file.stem))
    assert len(files) == len(numbers), f"{folder / name} has other frames"
    return [Image.open(file).convert("RGB") for file in files]


def joined(films: list[list[Image.Image]]) -> list[Image.Image]:
    """Return one loop of all films, in which the last frames of each are dissolved into the first ones of the next."""
    frames: list[Image.Image] = []
    for film, before in zip(films, [films[-1], *films], strict=False):
        for k in range(NUM_DISSOLVED):
            share = (k + 1) / (NUM_DISSOLVED + 1)
            frames.append(Image.blend(before[NUM_FRAMES + k], film[k], share))
        frames += film[NUM_DISSOLVED:NUM_FRAMES]
    return frames[NUM_DISSOLVED:] + frames[:NUM_DISSOLVED]  # the first frame, which stands for the film, is whole


def main(folder: Path) -> None:
    """Draw all scenes into a folder, and write the film."""
    first, *others = joined([draw(name, folder) for name in SCENES])
    # Each frame is whole (`kmax=1`): this is smaller than differences, which leave outlines of earlier frames.
    options: dict[str, Any] = {"duration": DURATION, "loop": 0, "quality": QUALITY, "method": 6, "kmin": 0, "kmax": 1}
    first.save(FILM, save_all=True, append_images=others, **options)
    print(f"{FILM.name}: {len(others) + 1} frames, {FILM.stat().st_size} bytes")


if __name__ == "__main__":
    if len(sys.argv) > 1:
        main(Path(sys.argv[1]))
    else:
        with tempfile.TemporaryDirectory() as temporary:
            main(Path(temporary))
