"""The scene's `output`: which file, how large, and what goes with which format."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path, PurePath
from typing import Any

from renderer.scene.parse_transfer import COLOR
from renderer.scene.schema import (
    INVALID,
    TILDE_HINT,
    Kind,
    Node,
    Table,
    has_unexpanded_tilde,
    integer,
    known,
    number,
    section,
    sequence,
    show,
)
from renderer.scene.spec import FRAME_FIELD, OutputSpec

MAX_SIDE = 16384

# A GIF's delay is a whole number of centiseconds, and browsers take a delay of 1 for 10.
MAX_GIF_RATE = 50

_FILE_WORDS = "a .mp4 or .gif, frames such as frames/{frame:04}.png or, for one frame (--frames 7), still.png"


def _parse_file(node: Node) -> Path:
    if not isinstance(node.value, str) or not node.value.strip() or "\0" in node.value:
        return OUTPUT_FILE.refuse(node, "not a file name", got=show(node.value))
    if has_unexpanded_tilde(node.value):
        return OUTPUT_FILE.refuse(node, "a folder named ~", got=show(node.value), hint=TILDE_HINT)
    name = PurePath(node.value).name
    suffix = PurePath(name).suffix.lower()
    if suffix not in _SUFFIXES or node.value.endswith(("/", "\\")):
        return OUTPUT_FILE.refuse(node, "unknown output format", got=show(node.value))
    rest, num_fields = FRAME_FIELD.subn("", node.value)
    if num_fields > 1 or "{" in rest or "}" in rest or (num_fields and not FRAME_FIELD.search(name)):
        expected = "one {frame} or {frame:04}, in the name of the file, and no other braces"
        return OUTPUT_FILE.refuse(node, "not a legal template", got=show(node.value), expected=expected)
    if suffix != ".png" and num_fields:
        what = f"a film and frames at once: {suffix} with a frame number"
        return OUTPUT_FILE.refuse(node, what, got=show(node.value))
    return Path(node.value)


_SUFFIXES = (".mp4", ".gif", ".png")
OUTPUT_FILE: Kind[Path] = Kind(_FILE_WORDS, _parse_file)
_SIZE = sequence(integer(least=1, most=MAX_SIDE), f"[width, height]: two whole numbers from 1 to {MAX_SIDE}", count=2)
_BACKGROUND: Kind[Any] = Kind(
    COLOR.expected + ", or transparent",
    lambda node: None if node.value == "transparent" else COLOR.read(node),
    COLOR.empty_hint,
)

_FIELDS: Table = {
    "file": OUTPUT_FILE,
    "size": _SIZE,
    "frames_per_second": number(least=0.01, most=1000),
    "background": _BACKGROUND,
    "quality": number(least=0, most=10),
}


def _build_output(node: Node, given: dict[str, Any]) -> OutputSpec:
    file, size = given["file"], given.get("size", OutputSpec.size)
    suffix = file.suffix.lower() if isinstance(file, Path) else None
    if suffix in (".mp4", ".gif") and given.get("background", INVALID) is None:
        node.child("background").complain(
            f"a transparent background in {suffix}",
            expected="a color",
            hint="only PNG frames can be transparent: file: frames/{frame:04}.png",
        )
    if suffix == ".mp4" and size is not INVALID and INVALID not in size and any(side % 2 for side in size):
        legal = [side + side % 2 for side in size]
        node.child("size").complain(
            "odd sizes cannot be encoded as MP4",
            got=show(size),
            expected="even numbers",
            hint=f"the nearest is {legal}",
        )
    if suffix == ".gif" and known(given, "frames_per_second") and given["frames_per_second"] > MAX_GIF_RATE:
        node.child("frames_per_second").complain(
            "too fast for a GIF",
            got=show(given["frames_per_second"]),
            expected=f"at most {MAX_GIF_RATE}: viewers slow down faster ones",
        )
    return OutputSpec(**given)


OUTPUT = section(_FIELDS, _build_output, required=("file",))


def check_frame_field(node: Node, given: Mapping[str, Any]) -> None:
    """Complain about one name for the pictures of several frames; `given` is of the whole scene."""
    num_frames = getattr(getattr(given["camera"], "path", None), "frames", INVALID)
    file = getattr(given["output"], "file", INVALID)
    if INVALID in (num_frames, file) or num_frames == 1:
        return
    if file.suffix.lower() != ".png" or FRAME_FIELD.search(file.name):
        return
    node.child("file").complain(
        "frames need a number in their names",
        got=show(str(file)),
        expected=_FILE_WORDS,
        hint=f"write {file.stem}-{{frame:04}}.png",
    )
