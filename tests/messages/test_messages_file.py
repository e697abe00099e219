"""Whole messages about scene files as a whole, YAML, several mistakes at once, and options of the command line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from renderer.errors import InputError
from renderer.scene import load_scene

# What is replaced in the scene, by what, and what is said about it.
YAML_CASES = {
    "tab": (
        "  distance: 300",
        "\tdistance: 300",
        """\
scene.yaml:12:1: not valid YAML: a tab
    | distance: 300
    | ^
  hint: indent with spaces
""",
    ),
    "second_colon": (
        "distance: 300",
        "distance: 300: 4",
        """\
scene.yaml:12:16: not valid YAML: a colon that cannot be there
    | distance: 300: 4
    |              ^
  hint: put text with a colon in quotes; check the indentation
""",
    ),
    "no_colon": (
        "distance: 300",
        "distance 300",
        """\
scene.yaml:13:3: not valid YAML: a key without a colon
    | path: {type: turntable, frames: 120, elevation: 20}
    | ^
  hint: write `key: value`, with a blank after the colon
""",
    ),
    "indentation": (
        "  distance: 300",
        " distance: 300",
        """\
scene.yaml:12:2: not valid YAML: this does not belong to what is above it
    | distance: 300
    | ^
  hint: compare its indentation with that of line 1
""",
    ),
    "open_bracket": (
        "[512, 512]",
        "[512, 512",
        """\
scene.yaml:22:13: not valid YAML: expected ',' or ']', but got ':'
    | background: "#000000"
    |           ^
  hint: it belongs to what begins in line 21
""",
    ),
    "open_braces": (
        "  distance: 300\n  path: {type: turntable, frames: 120, elevation: 20}",
        "  path: {type: turntable, frames: 120, elevation: 20\n  distance: 300",
        """\
scene.yaml:13:11: not valid YAML: expected ',' or '}', but got ':'
    | distance: 300
    |         ^
  hint: it belongs to what begins in line 12
""",
    ),
    "unquoted_color": (
        'color: "#6680e6"',
        "color: #6680e6",
        """\
scene.yaml:9:5: not valid YAML: a value that is missing or not finished
    | - {value: 255, color: white, opacity: 0.5}
    | ^
  hint: put colors in quotes, for # begins a comment: "#ff8800"
""",
    ),
    "unquoted_template": (
        """\
  file: engine.mp4
  size: [512, 512]
  background: "#000000"
""",
        "  {file: fr/{frame:04}.png, size: [512, 512]}\n",
        """\
scene.yaml:20:13: not valid YAML: expected ',' or '}', but got '{'
    | {file: fr/{frame:04}.png, size: [512, 512]}
    |           ^
  hint: put names with braces in quotes: "frames/{frame:04}.png"
""",
    ),
    "unquoted_number": (
        "file: engine.mp4",
        "file: {frame:04}.png",
        """\
scene.yaml:20:19: not valid YAML: this does not belong to what is above it
    | file: {frame:04}.png
    |                 ^
  hint: put names with braces in quotes: "frames/{frame:04}.png"
""",
    ),
    "open_quote": (
        'background: "#000000"',
        'background: "#000000',
        """\
scene.yaml:23:1: not valid YAML: a quote that is not closed
  hint: it is opened in line 22
""",
    ),
    "key_twice": (
        "distance: 300",
        "distance: 300\n  distance: 200",
        """\
scene.yaml:13:3: camera.distance: the same key twice
    | distance: 200
    | ^
  hint: it is in line 12, too
""",
    ),
    "tag": (
        "distance: 300",
        "distance: !!python/name:os.system 3",
        """\
scene.yaml:12:13: camera.distance: tags are not used here
    | distance: !!python/name:os.system 3
    |           ^
  got: 'tag:yaml.org,2002:python/name:os.system'
  hint: remove what begins with !
""",
    ),
    "alias": (
        "distance: 300",
        "distance: *far",
        """\
scene.yaml:12:13: not valid YAML: an alias without an anchor
    | distance: *far
    |           ^
  hint: put text that begins with * in quotes
""",
    ),
    "list_for_a_key": (
        "distance: 300",
        "? [a, b]\n  : 300",
        """\
scene.yaml:12:5: camera: a key that is a list or a mapping
    | ? [a, b]
    |   ^
  expected: text or a number
""",
    ),
    "second_document": (
        "version: 1",
        "version: 1\n---\nversion: 1",
        """\
scene.yaml:2:1: not valid YAML: a second document
    | ---
    | ^
  hint: one document a file: remove everything from this --- on
""",
    ),
    "several": (
        "projection: perspective\n  distance: 300\n  path: {type: turntable, frames: 120, elevation: 20}\nerror:",
        "distance: -3\n  distance: 5\n  path: {type: turntable, elevation: north}\nerrors:",
        """\
scene.yaml:11:13: camera.distance: out of range
    | distance: -3
    |           ^
  got: -3
  expected: a number from 1e-30 to 1e+30
scene.yaml:12:3: camera.distance: the same key twice
    | distance: 5
    | ^
  hint: it is in line 11, too
scene.yaml:13:3: camera.path.frames: missing
    | path: {type: turntable, elevation: north}
    | ^
  expected: a whole number from 1 to 1000000
scene.yaml:13:38: camera.path.elevation: not a number
    | path: {type: turntable, elevation: north}
    |                                    ^
  got: 'north'
  expected: a number from -90 to 90
scene.yaml:14:1: errors: unknown key
    | errors:
    | ^
  expected: version, volume, transfer_function, shading, camera, error, pyramid, splat, overlay or output
  hint: did you mean error?
""",
    ),
}


@pytest.mark.parametrize(("old", "new", "message"), YAML_CASES.values(), ids=YAML_CASES)
def test_yaml(complaint: Callable[[str, str], str], old: str, new: str, message: str) -> None:
    assert complaint(old, new) + "\n" == message


NO_SCENES = {
    "empty": (
        b"# only a comment\n",
        """\
scene.yaml: not a scene
  got: an empty file
  expected: the keys volume, transfer_function, camera and output
""",
    ),
    "list": (
        b"- a\n- {b: 0.50}\n",
        """\
scene.yaml: not a scene
  got: ['a', {b: 0.5}]
  expected: the keys volume, transfer_function, camera and output
""",
    ),
    "latin_1": (
        b"version: 1\noutput: {file: caf\xe9.mp4}\n",
        """\
scene.yaml:2: not a text file in UTF-8
  got: the byte 0xe9
  hint: save it in UTF-8
""",
    ),
    "utf_16": (
        "version: 1\n".encode("utf-16-le").join([b"\xff\xfe", b""]),
        """\
scene.yaml:1: not a text file in UTF-8
  got: the byte 0xff
  hint: save it in UTF-8
""",
    ),
    "volume": (
        bytes(300) + b"\xff",
        """\
scene.yaml:1: not a text file in UTF-8
  got: the byte 0xff
  hint: a volume is rendered with `hsplat turntable FILE`, or with `hsplat render SCENE --volume FILE`
""",
    ),
    "nrrd": (
        b"NRRD0004\n# made by hand\ntype: uint8\ndimension: 3\nsizes: 8 7 6\nencoding: raw\ndata file: v.raw\n",
        """\
scene.yaml: a volume, not a scene
  expected: a scene file
  hint: a volume is rendered with `hsplat turntable FILE`, or with `hsplat render SCENE --volume FILE`
""",
    ),
    "metaimage": (
        b"NDims = 3\r\nDimSize = 8 7 6\r\nElementType = MET_UCHAR\r\nElementDataFile = v.raw\r\n",
        """\
scene.yaml: a volume, not a scene
  expected: a scene file
  hint: a volume is rendered with `hsplat turntable FILE`, or with `hsplat render SCENE --volume FILE`
""",
    ),
    "control_character": (
        b"version: 1\nvolume: {file: a\x07b}\n",
        """\
scene.yaml:2:17: not valid YAML: the character 7 may not be in it
""",
    ),
    "no_such_character": (
        b'version: "\\UFFFFFFFF"\n',
        """\
scene.yaml: not valid YAML: an escape for a character that does not exist
""",
    ),
    "too_large": (
        b"#" * (2**20 + 1),
        """\
scene.yaml: too large for a scene
  expected: at most 1048576 bytes
""",
    ),
    "too_deep": (
        b"[" * 5000,
        """\
scene.yaml:1:51: not valid YAML: more than 50 levels
""",
    ),
    "anchor_in_itself": (
        b"a: &a [*a]\n",
        """\
scene.yaml:1:4: not valid YAML: more than 50 levels
    | a: &a [*a]
    |    ^
""",
    ),
    "billion_laughs": (
        b"a: &a [x, x, x, x, x, x, x, x, x, x]\n"
        + b"".join(b"%c: &%c [%s]\n" % (i + 1, i + 1, b", ".join([b"*%c" % i] * 10)) for i in b"abcdefgh"),
        """\
scene.yaml: not valid YAML: more than 20000 values
""",
    ),
}


@pytest.mark.parametrize(("content", "message"), NO_SCENES.values(), ids=NO_SCENES)
@pytest.mark.usefixtures("scene_folder")
def test_what_is_no_scene(content: bytes, message: str) -> None:
    Path("scene.yaml").write_bytes(content)
    with pytest.raises(InputError) as caught:
        load_scene(Path("scene.yaml"))
    assert str(caught.value) + "\n" == message


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("scen.yaml", "scen.yaml: no such file\n  hint: did you mean scene.yaml?"),
        ("nowhere/scene.yaml", "nowhere/scene.yaml: no such file"),
        (".", ".: a folder\n  expected: a scene file"),
        ("a" * 999, f"{'a' * 999}: cannot be read: File name too long"),
    ],
    ids=["misspelt", "no_folder", "folder", "long"],
)
@pytest.mark.usefixtures("scene_folder")
def test_no_such_scene(name: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        load_scene(Path(name))
    assert str(caught.value) == message


OVERRIDES = {
    "camera.distance=-3": """\
--set camera.distance=-3: camera.distance: out of range
  got: -3
  expected: a number from 1e-30 to 1e+30
""",
    "camra.distance=3": """\
--set camra.distance=3: camra: unknown key
  expected: version, volume, transfer_function, shading, camera, error, pyramid, splat, overlay or output
  hint: did you mean camera?
""",
    "camera.path={type: rocker}": """\
--set camera.path={type: rocker}: camera.path.frames: missing
  expected: a whole number from 1 to 1000000
""",
    "error.tolerance={0: 1, 5: 0}": """\
--set error.tolerance={0: 1, 5: 0}: error.tolerance.5: 0 in a tolerance by frame, with frames between it and another
  got: {0: 1, 5: 0}
  expected: a number greater than 0
  hint: it is interpolated in the logarithm; {0: 1, 4: 1, 5: 0} goes from one to the other at once
""",
    "transfer_function.points.1.opacity=2": """\
--set transfer_function.points.1.opacity=2: transfer_function.points.1.opacity: out of range
  got: 2
  expected: a number from 0 to 1
""",
    "transfer_function.points.3.opacity=0": """\
--set transfer_function.points.3.opacity=0: transfer_function.points: no such item in this list
  got: 3
  expected: a number from 0 to 2
""",
    "camera.distance.x=3": """\
--set camera.distance.x=3: camera.distance: neither a mapping nor a list
  got: 300
""",
    "output.background=#ff": """\
--set output.background=#ff: output.background: not a color
  got: '#ff'
  expected: a color: "#rrggbb", "#rgb", [red, green, blue] from 0 to 1, or a name such as white
""",
    "camera.distance=": """\
--set camera.distance=: camera.distance: no value
  expected: --set path.to.key=value
  hint: to take the key away, give camera.distance=null
""",
    "camera.distance": """\
--set camera.distance: not an override
  expected: --set path.to.key=value
""",
    "output.size=[512": """\
--set output.size=[512: not valid YAML: expected ',' or ']', but got '<stream end>'
""",
    "splat={sigma: 0.4, sigma: 0.5}": """\
--set splat={sigma: 0.4, sigma: 0.5}: splat.sigma: the same key twice
""",
    "camera=null": """\
--set camera=null: camera: missing
  expected: a mapping with path
""",
}


@pytest.mark.parametrize(("override", "message"), OVERRIDES.items(), ids=OVERRIDES)
@pytest.mark.usefixtures("scene_folder")
def test_overrides(override: str, message: str) -> None:
    with pytest.raises(InputError) as caught:
        load_scene(Path("scene.yaml"), overrides=[override])
    assert str(caught.value) + "\n" == message


def test_options_come_last_and_in_their_order(scene_folder: Path) -> None:
    scene = Path("scene.yaml")
    scene.write_text(scene.read_text(encoding="utf-8").replace("tolerance: 0.1", "tolerance: -1"), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_scene(
            scene,
            overrides=["output.size=[3, 3, 3]", "camera.near=-1"],
            volume=Path("scan.nrr"),
            output=Path("engine.mov"),
        )
    assert (
        str(caught.value).replace(str(scene_folder), "/scans") + "\n"
        == """\
scene.yaml:16:14: error.tolerance: out of range
    | tolerance: -1
    |            ^
  got: -1
  expected: a number of at least 0
--set output.size=[3, 3, 3]: output.size: wrong number of items
  got: [3, 3, 3]
  expected: [width, height]: two whole numbers from 1 to 16384
--set camera.near=-1: camera.near: out of range
  got: -1
  expected: a number from 0 to 1e+30
--volume scan.nrr: volume.file: no such file
  got: /scans/scan.nrr
  expected: an NRRD, MetaImage, NIfTI, TIFF or .npy file, or a folder of DICOM or TIFF slices
  hint: did you mean scan.nrrd?
--output engine.mov: output.file: unknown output format
  got: 'engine.mov'
  expected: a .mp4 or .gif, frames such as frames/{frame:04}.png or, for one frame (--frames 7), still.png
"""
    )
