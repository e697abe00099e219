"""Whole messages about the transfer function, splats and the output."""

from __future__ import annotations

from collections.abc import Callable

import pytest

POINTS = """\
  points:
    - {value: 0, color: "#000000", opacity: 0.0}
    - {value: 90, color: "#6680e6", opacity: 0.01}
    - {value: 255, color: white, opacity: 0.5}
"""

# What is replaced in the scene, by what, and what is said about it.
CASES = {
    "odd_size": (
        "size: [512, 512]",
        "size: [511, 512]",
        """\
scene.yaml:21:9: output.size: odd sizes cannot be encoded as MP4
    | size: [511, 512]
    |       ^
  got: [511, 512]
  expected: even numbers
  hint: the nearest is [512, 512]
""",
    ),
    "color_name": (
        "color: white",
        "color: withe",
        """\
scene.yaml:9:27: transfer_function.points.2.color: not a color
    | - {value: 255, color: withe, opacity: 0.5}
    |                       ^
  got: 'withe'
  expected: a color: "#rrggbb", "#rgb", [red, green, blue] from 0 to 1, or a name such as white
  hint: did you mean white?
""",
    ),
    "color_0_to_255": (
        "color: white",
        "color: [255, 128, 0]",
        """\
scene.yaml:9:27: transfer_function.points.2.color: not a color
    | - {value: 255, color: [255, 128, 0], opacity: 0.5}
    |                       ^
  got: [255, 128, 0]
  expected: a color: "#rrggbb", "#rgb", [red, green, blue] from 0 to 1, or a name such as white
  hint: write it as "#ff8000"
""",
    ),
    "points_out_of_order": (
        "value: 90",
        "value: -90",
        """\
scene.yaml:8:15: transfer_function.points.1.value: points out of order
    | - {value: -90, color: "#6680e6", opacity: 0.01}
    |           ^
  got: -90
  expected: at least 0, as in the point before
""",
    ),
    "nothing_visible": (
        POINTS,
        """\
  points:
    - {value: 0, color: "#000000", opacity: 0.0}
""",
        """\
scene.yaml:6:3: transfer_function.points: nothing is visible: every opacity is 0
    | points:
    | ^
  expected: an opacity greater than 0
""",
    ),
    "no_points": (
        POINTS,
        """\
  points: []
""",
        """\
scene.yaml:6:11: transfer_function.points: wrong number of items
    | points: []
    |         ^
  got: []
  expected: a list of {value: ..., color: ..., opacity: ...}, one or more
""",
    ),
    "points_and_colormap": (
        "  unit: 1.0",
        "  colormap: viridis",
        """\
scene.yaml:5:3: transfer_function.colormap: contradicts transfer_function.points
    | colormap: viridis
    | ^
  expected: either points, or colormap with range and opacity
""",
    ),
    "unknown_colormap": (
        """\
  unit: 1.0
  points:
    - {value: 0, color: "#000000", opacity: 0.0}
    - {value: 90, color: "#6680e6", opacity: 0.01}
    - {value: 255, color: white, opacity: 0.5}
""",
        """\
  colormap: virides_r
  opacity: [[0, 0], [255, 1]]
""",
        """\
scene.yaml:4:1: transfer_function.range: missing
    | transfer_function:
    | ^
  expected: [low, high]: two numbers, low less than high
  hint: `hsplat info` shows the values of a volume
scene.yaml:5:13: transfer_function.colormap: unknown colormap
    | colormap: virides_r
    |           ^
  got: 'virides_r'
  expected: a name such as viridis, gray, cividis_r or crameri:batlow
  hint: did you mean viridis_r?
""",
    ),
    "reversed_range": (
        """\
  unit: 1.0
  points:
    - {value: 0, color: "#000000", opacity: 0.0}
    - {value: 90, color: "#6680e6", opacity: 0.01}
    - {value: 255, color: white, opacity: 0.5}
""",
        """\
  colormap: viridis
  range: [255, 0]
  opacity: [[0, 0], [255, 1]]
""",
        """\
scene.yaml:6:10: transfer_function.range: not ascending
    | range: [255, 0]
    |        ^
  got: [255, 0]
  expected: [low, high]: two numbers, low less than high
  hint: append _r to the name to reverse a colormap
""",
    ),
    "no_transfer_function": (
        POINTS,
        "",
        """\
scene.yaml:4:1: transfer_function: no colors and opacities
    | transfer_function:
    | ^
  expected: points, or colormap with range and opacity
""",
    ),
    "gouraud_setting": (
        "footprint: gaussian",
        """\
footprint: gaussian
  angular: 8\
""",
        """\
scene.yaml:19:3: splat.angular: contradicts footprint: gaussian
    | angular: 8
    | ^
  hint: only footprint: gouraud has it
""",
    ),
    "gouraud_setting_without_a_footprint": (
        "footprint: gaussian",
        "angular: 8",
        """\
scene.yaml:18:3: splat.angular: needs footprint: gouraud
    | angular: 8
    | ^
  hint: this section gives no footprint, so it is gaussian, which has no angular
""",
    ),
    "profile_without_weight": (
        "footprint: gaussian",
        "{footprint: gouraud, radial: 2, profile: [[0, 0], [0.25, 1], [0.5, 0], [1, 0]]}",
        """\
scene.yaml:18:44: splat.profile: no weight at the radii that the footprint has
    | {footprint: gouraud, radial: 2, profile: [[0, 0], [0.25, 1], [0.5, 0], [1, 0]]}
    |                                          ^
  got: [[0, 0], [0.25, 1], [0.5, 0], [1, 0]]
  expected: a weight of at least 1e-06 at one of the radii k / 2
  hint: a larger splat.radial has more radii
""",
    ),
    "settings_of_others": (
        "footprint: gaussian",
        """\
footprint: integrated
  sigma: 0.5
  radial: 3
  opacity_correction: true
  order: boxes\
""",
        """\
scene.yaml:19:3: splat.sigma: contradicts footprint: integrated
    | sigma: 0.5
    | ^
  hint: it draws the field itself, which no footprint blurs
scene.yaml:20:3: splat.radial: contradicts footprint: integrated
    | radial: 3
    | ^
  hint: only footprint: gouraud has it
scene.yaml:21:3: splat.opacity_correction: contradicts footprint: integrated
    | opacity_correction: true
    | ^
  hint: it integrates opacity along each ray, which includes the correction
scene.yaml:22:3: splat.order: contradicts footprint: integrated
    | order: boxes
    | ^
  hint: bricks do not overlap, so their only order is exact
""",
    ),
    "unknown_footprint": (
        "footprint: gaussian",
        "footprint: intergrated",
        """\
scene.yaml:18:14: splat.footprint: unknown value
    | footprint: intergrated
    |            ^
  got: 'intergrated'
  expected: gaussian, gouraud or integrated
  hint: did you mean integrated?
""",
    ),
    "another_name_of_a_footprint": (
        "footprint: gaussian",
        "footprint: bricks",
        """\
scene.yaml:18:14: splat.footprint: unknown value
    | footprint: bricks
    |            ^
  got: 'bricks'
  expected: gaussian, gouraud or integrated
  hint: did you mean integrated?
""",
    ),
    "profile": (
        "footprint: gaussian",
        """\
footprint: gouraud
  profile: [[0, 1], [0.5, 0]]\
""",
        """\
scene.yaml:19:12: splat.profile: radius does not ascend from 0 to 1
    | profile: [[0, 1], [0.5, 0]]
    |          ^
  got: [0, 0.5]
  expected: a list of [radius, weight], both from 0 to 1, with radius ascending from 0 to 1
""",
    ),
    "transparent_film": (
        'background: "#000000"',
        "background: transparent",
        """\
scene.yaml:22:15: output.background: a transparent background in .mp4
    | background: transparent
    |             ^
  expected: a color
  hint: only PNG frames can be transparent: file: frames/{frame:04}.png
""",
    ),
    "film_and_frames": (
        "file: engine.mp4",
        "file: engine-{frame:04}.mp4",
        """\
scene.yaml:20:9: output.file: a film and frames at once: .mp4 with a frame number
    | file: engine-{frame:04}.mp4
    |       ^
  got: 'engine-{frame:04}.mp4'
  expected: a .mp4 or .gif, frames such as frames/{frame:04}.png or, for one frame (--frames 7), still.png
""",
    ),
    "frames_without_number": (
        "file: engine.mp4",
        "file: engine.png",
        """\
scene.yaml:20:9: output.file: frames need a number in their names
    | file: engine.png
    |       ^
  got: 'engine.png'
  expected: a .mp4 or .gif, frames such as frames/{frame:04}.png or, for one frame (--frames 7), still.png
  hint: write engine-{frame:04}.png
""",
    ),
    "two_fields": (
        "file: engine.mp4",
        'file: "{frame}-{frame:04}.png"',
        """\
scene.yaml:20:9: output.file: not a valid template
    | file: "{frame}-{frame:04}.png"
    |       ^
  got: '{frame}-{frame:04}.png'
  expected: one {frame} or {frame:04}, in the name of the file, and no other braces
""",
    ),
    "unknown_format": (
        "file: engine.mp4",
        "file: engine.avi",
        """\
scene.yaml:20:9: output.file: unknown output format
    | file: engine.avi
    |       ^
  got: 'engine.avi'
  expected: a .mp4 or .gif, frames such as frames/{frame:04}.png or, for one frame (--frames 7), still.png
""",
    ),
    "no_home": (
        "file: engine.mp4",
        "file: ~/engine.mp4",
        """\
scene.yaml:20:9: output.file: a folder named ~
    | file: ~/engine.mp4
    |       ^
  got: '~/engine.mp4'
  expected: a .mp4 or .gif, frames such as frames/{frame:04}.png or, for one frame (--frames 7), still.png
  hint: ~ is not expanded: write the whole path
""",
    ),
    "gif_rate": (
        "file: engine.mp4",
        """\
file: engine.gif
  frames_per_second: 60\
""",
        """\
scene.yaml:21:22: output.frames_per_second: too fast for a GIF
    | frames_per_second: 60
    |                    ^
  got: 60
  expected: at most 50: viewers slow down faster ones
""",
    ),
}


@pytest.mark.parametrize(("old", "new", "message"), CASES.values(), ids=CASES)
def test_message(complaint: Callable[[str, str], str], old: str, new: str, message: str) -> None:
    assert complaint(old, new) + "\n" == message
