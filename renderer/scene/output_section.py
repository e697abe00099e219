"""The scene's `output`: the file, its size, and what each format allows."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Annotated, Any

from renderer.scene import schema
from renderer.scene.colors import COLOR_FIELD
from renderer.scene.schema import INVALID, Color, TreeNode

# The frame number in file names, padded with zeros to at most nine digits, so that names sort in frame order.
FRAME_FIELD = re.compile(r"\{frame(:0[1-9]d?)?\}")

MAX_SIDE = 16384

# A GIF's delay is a whole number of centiseconds, and browsers show a delay of 1 as 10.
MAX_GIF_RATE = 50

_FILE_WORDS = "a .mp4 or .gif, frames such as frames/{frame:04}.png or, for one frame (--frames 7), still.png"


def _parse_file(node: TreeNode) -> Any:
    if not schema.is_file_name(node.value):
        return node.reject("not a file name")
    if schema.has_unexpanded_tilde(node.value):
        return node.reject("a folder named ~", hint=schema.TILDE_HINT)
    if os.path.basename(node.value) in ("", ".", ".."):  # which a Path would leave out
        return node.reject("the output is a folder")
    name = PurePath(node.value).name
    suffix = PurePath(name).suffix.lower()
    if suffix not in _SUFFIXES:
        return node.reject("unknown output format")
    rest, num_fields = FRAME_FIELD.subn("", node.value)
    if num_fields > 1 or "{" in rest or "}" in rest or (num_fields and not FRAME_FIELD.search(name)):
        expected = "one {frame} or {frame:04}, in the name of the file, and no other braces"
        return node.reject("not a valid template", expected=expected)
    if suffix != ".png" and num_fields:
        return node.reject(f"a film and frames at once: {suffix} with a frame number")
    return Path(node.value)


_SUFFIXES = (".mp4", ".gif", ".png")
OUTPUT_FILE_FIELD = schema.FieldType(_FILE_WORDS, _parse_file)
_SIZE = schema.sequence_field(
    schema.integer_field(minimum=1, maximum=MAX_SIDE),
    f"[width, height]: two whole numbers from 1 to {MAX_SIDE}",
    count=2,
)
_BACKGROUND = schema.word_or({"transparent": None}, COLOR_FIELD, COLOR_FIELD.expected + ", or transparent")


@dataclass(frozen=True)
class OutputSpec:
    """An output: the file that is written, the size of its frames, and its encoding.

    file: ends in .mp4 or .gif, or is a template of PNG frames such as `frames/{frame:04}.png` or, for one frame, a PNG.
        background: None is transparent (PNG, straight alpha). quality: 0 (smallest) to 10 (best), for MP4.
    record_paths: whether sidecars and reports say in which folders the volume and the film are.
    """

    file: Annotated[Path, OUTPUT_FILE_FIELD]
    size: Annotated[tuple[int, int], _SIZE] = (512, 512)
    frames_per_second: Annotated[float, schema.number_field(minimum=0.01, maximum=1000, motion=None)] = 30.0
    background: Annotated[Color | None, _BACKGROUND] = (0.0, 0.0, 0.0)
    quality: Annotated[float, schema.number_field(minimum=0, maximum=10, motion=None)] = 8.0
    record_paths: bool = True


def _check_output(node: TreeNode, given: dict[str, Any]) -> None:
    file, size = given["file"], given.get("size", OutputSpec.size)
    suffix = file.suffix.lower() if isinstance(file, Path) else None
    if suffix in (".mp4", ".gif") and given.get("background", INVALID) is None:
        hint = "only PNG frames can be transparent: file: frames/{frame:04}.png"
        node.child("background").reject(f"a transparent background in {suffix}", expected="a color", hint=hint)
    if suffix == ".mp4" and size is not INVALID and INVALID not in size and any(side % 2 for side in size):
        hint = f"the nearest is {[side + side % 2 for side in size]}"
        node.child("size", size).reject("odd sizes cannot be encoded as MP4", expected="even numbers", hint=hint)
    rate = given.get("frames_per_second", INVALID)
    if suffix == ".gif" and rate is not INVALID and rate > MAX_GIF_RATE:
        expected = f"at most {MAX_GIF_RATE}: viewers slow down faster ones"
        node.child("frames_per_second", rate).reject("too fast for a GIF", expected=expected)


OUTPUT_SECTION = schema.dataclass_field(OutputSpec, _check_output)


def check_frame_field(node: TreeNode, given: Mapping[str, Any]) -> None:
    """Check that the name of several frames has a number; `given` holds the sections of the whole scene."""
    camera = given["camera"]
    num_frames = getattr(getattr(camera, "path", None), "frames", INVALID)
    file = getattr(given["output"], "file", INVALID)
    if INVALID in (num_frames, file) or camera.num_frames == 1:
        return
    if file.suffix.lower() == ".png" and not FRAME_FIELD.search(file.name):
        node.child("file", str(file)).reject(
            "frames need a number in their names", expected=_FILE_WORDS, hint=f"write {file.stem}-{{frame:04}}.png"
        )
