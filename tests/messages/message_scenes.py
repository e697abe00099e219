"""The scenes that tests of messages begin with: they have no mistake."""

from __future__ import annotations

from pathlib import Path

SCENE = Path(__file__).with_name("scene.yaml").read_text("utf-8")

# The scene of a volume that a test writes.
SCAN_SCENE = """\
volume: {file: scan.npy}
transfer_function: {points: [{value: 0, color: white, opacity: 0}, {value: 60, color: white, opacity: 1}]}
camera: {path: {type: turntable, frames: 2}}
output: {file: film.mp4, size: [32, 32]}
"""


def shorter_scene(num_frames: int) -> str:
    """Return SCENE with few frames, pixels and voxels."""
    text = SCENE
    for old, new in (("120", str(num_frames)), ("[512, 512]", "[32, 32]"), ("[64, 64, 32]", "[8, 8, 8]")):
        assert text.count(old) == 1
        text = text.replace(old, new)
    return text
