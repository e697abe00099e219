"""Scenes with one mistake each, which the JSON Schema of scenes finds in the line of the mistake."""

from __future__ import annotations

GOOD = """\
version: 1
volume:
  file: scan.nrrd
  level: auto
transfer_function:
  unit: 1
  points:
    - {value: 0, color: black, opacity: 0}
    - {value: 255, color: "#ffffff", opacity: {0: 0.5, -1: 0.9, easing: smooth}}
light:
  environment: studio
  key: {direction: camera, radius: 14}
camera:
  field_of_view: {0: 30, 2.5s: 20}
  path: {type: turntable, frames: 120, elevation: 20}
clip:
  - plane: {point: [0, 0, 0], normal: [0, 0, 1]}
    fixed: camera
error:
  tolerance: 0.1
output:
  file: film.mp4
  size: [64, 64]
  background: {top: white, bottom: black}
annotation:
  title: Engine
  color_bar: {length: 0.5}
"""

# Each mistake: a line of GOOD without its indentation, and the line that takes its place.
MISTAKES = {
    "a misspelt section": ("error:", "eror:"),
    "a misspelt key": ("tolerance: 0.1", "tolerence: 0.1"),
    "a misspelt key in braces": ("color_bar: {length: 0.5}", "color_bar: {lenght: 0.5}"),
    "text for a number": ("unit: 1", "unit: thick"),
    "a number for text": ("title: Engine", "title: 12"),
    "a list for a mapping": ("key: {direction: camera, radius: 14}", "key: [camera, 14]"),
    "too small": ("key: {direction: camera, radius: 14}", "key: {direction: camera, radius: 0.01}"),
    "too large": ("field_of_view: {0: 30, 2.5s: 20}", "field_of_view: 180"),
    "too large at a frame": ("field_of_view: {0: 30, 2.5s: 20}", "field_of_view: {0: 30, 2.5s: 200}"),
    "no frame": ("field_of_view: {0: 30, 2.5s: 20}", "field_of_view: {0: 30, end: 20}"),
    "an unknown easing": (
        '- {value: 255, color: "#ffffff", opacity: {0: 0.5, -1: 0.9, easing: smooth}}',
        '- {value: 255, color: "#ffffff", opacity: {0: 0.5, -1: 0.9, easing: soft}}',
    ),
    "an unknown word": ("fixed: camera", "fixed: viewer"),
    "neither word nor number": ("level: auto", "level: finest"),
    "an unknown environment": ("environment: studio", "environment: studios"),
    "an unknown color": ("background: {top: white, bottom: black}", "background: {top: whit, bottom: black}"),
    "no color": ("- {value: 0, color: black, opacity: 0}", '- {value: 0, color: "#00", opacity: 0}'),
    "an unknown kind of path": (
        "path: {type: turntable, frames: 120, elevation: 20}",
        "path: {type: turning, frames: 120, elevation: 20}",
    ),
    "a key of another path": (
        "path: {type: turntable, frames: 120, elevation: 20}",
        "path: {type: turntable, frames: 120, swing: 20}",
    ),
    "two lengths of a path": (
        "path: {type: turntable, frames: 120, elevation: 20}",
        "path: {type: turntable, frames: 120, seconds: 4}",
    ),
    "no length of a path": (
        "path: {type: turntable, frames: 120, elevation: 20}",
        "path: {type: turntable, elevation: 20}",
    ),
    "a list of another length": ("size: [64, 64]", "size: [64, 64, 64]"),
    "half a pixel": ("size: [64, 64]", "size: [64, 64.5]"),
    "two schedules": ("tolerance: 0.1", "{tolerance: 0.1, psnr: 40}"),
    "plane and box": ("fixed: camera", "box: [[0, 0, 0], [1, 1, 1]]"),
    "two sources of voxels": ("level: auto", "procedural: {name: constant, shape: [4, 4, 4]}"),
    "a missing key": (
        "- plane: {point: [0, 0, 0], normal: [0, 0, 1]}",
        "- plane: {point: [0, 0, 0]}",
    ),
    "another version": ("version: 1", "version: 2"),
}


def broken(name: str) -> tuple[str, int]:
    """Return a scene with one mistake, and the number, from 1, of the line with the mistake."""
    right, wrong = MISTAKES[name]
    lines = GOOD.splitlines()
    number = next(k for k, line in enumerate(lines) if line.strip() == right)
    indent = lines[number].partition(right)[0]
    lines[number] = indent + wrong
    return "\n".join(lines) + "\n", number + 1
