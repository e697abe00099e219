"""Which of two looks is better? `python tests/bench/blind_pairs.py DATA FOLDER` draws pairs in an order by chance.

FOLDER gets montages of numbered pairs without names, and key.json with the look on the left of each pair and the
seconds that both took, which is to be opened when all pairs have been judged. The page is docs/benchmarks/light.md.
"""

from __future__ import annotations

import json
import secrets
import time
from dataclasses import replace
from pathlib import Path

import imageio.v3 as iio
import numpy as np
from looks import VOLUMES, source
from measuring import parser_of

import renderer
from renderer.scene import FilmScene, Scene
from renderer.suggest import Suggestion, with_light
from renderer.volume import UInt8

SIDE = 240
GAP = 6
PAIRS_PER_MONTAGE = 6
# Looks besides those suggested without a wish: the words of --preset for a volume.
WISHES = [
    ("engine", "surface"),
    ("bonsai", "surface"),
    ("LIDC2, CT", "bone"),
    ("LIDC2, CT", "skin"),
    ("headsq_quarter, CT", "skin"),
    ("seg3d_MR", "surface"),
    ("CIT168_T1w", "surface"),
    ("benzene, orbital", "glow"),
]
# Voxels that are colours have no light, and this series is drawn from a few slices.
LEFT_OUT = ("CIT168_labels", "functional", "Marschner-Lobb")


def lit(scene: Scene) -> Scene:
    """Return a suggested scene in the light of a studio."""
    (layer,) = scene.layers
    of_layer = Suggestion("", "", layer.transfer_function, (), layer.shading)
    return replace(scene, layers=(replace(layer, shading=None),), light=with_light(of_layer, "studio").light)


def draw(scene: FilmScene, frame: int) -> tuple[UInt8, float]:
    """Return a frame and the seconds that it took."""
    start = time.perf_counter()
    picture = np.asarray(renderer.render_frame(scene, frame))[..., :3]
    return picture, time.perf_counter() - start


def main() -> None:
    """Draw the pairs."""
    parser = parser_of(__doc__)
    parser.add_argument("folder", type=Path)
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    looks = [(name, None) for name in VOLUMES if name not in LEFT_OUT]
    looks += WISHES
    secrets.SystemRandom().shuffle(looks)
    rows, key = [], []
    for number, (name, word) in enumerate(looks):
        volume, options = source(given.data / VOLUMES[name])
        options |= {"transfer_function": {"preset": word}} if word else {}
        scene = renderer.suggest_scene(volume, size=(SIDE, SIDE), **options)
        frame = secrets.choice((10, 45, 85))
        shaded, seconds = draw(scene, frame)
        in_light, light_seconds = draw(scene.changed(lit), frame)
        is_left = bool(secrets.randbelow(2))
        pair = [in_light, shaded] if is_left else [shaded, in_light]
        key.append(
            {"volume": name, "preset": word, "light_is_left": is_left, "seconds": seconds, "in_light": light_seconds}
        )
        (given.folder / "key.json").write_text(json.dumps(key, indent=1), "utf-8")
        gap = np.full((SIDE, GAP, 3), 90, np.uint8)
        rows.append(np.concatenate([pair[0], gap, pair[1]], axis=1))
        if len(rows) == PAIRS_PER_MONTAGE or number + 1 == len(looks):
            write_montage(given.folder / f"pairs_{number - len(rows) + 2:02}.png", rows)
            rows = []


def write_montage(file: Path, rows: list[UInt8]) -> None:
    """Write pairs in two columns."""
    rows += [np.zeros_like(rows[0])] * (len(rows) % 2)
    wide = np.full((SIDE, 4 * GAP, 3), 160, np.uint8)
    lines = [np.concatenate([rows[k], wide, rows[k + 1]], axis=1) for k in range(0, len(rows), 2)]
    between = np.full((4 * GAP, lines[0].shape[1], 3), 160, np.uint8)
    iio.imwrite(file, np.concatenate([part for line in lines for part in (line, between)]))


if __name__ == "__main__":
    main()
