"""Read and write golden.json: the frames in a folder of goldens, and their origin.

It has no times, so equal goldens give equal bytes. Others may have edited it, so everything is checked, also that texts
are safe to print and that file names stay in the folder.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

from hsplat_cli.compare.picture_file import file_content
from renderer.errors import InputError, Problem
from renderer.record import DIGEST_FIELD, FilmRecord, describe_differences, record_to_json
from renderer.scene import (
    FRAME_NUMBER_FIELD,
    check_frames_ascend,
    decode_utf8,
    format_value,
    load_json_object,
    may_be_json,
    raise_problems,
    schema,
    short_text,
)

PROVENANCE_FILE = "golden.json"
FORMAT = "hsplat golden 2"

# A million goldens, about 120 bytes each.
MAX_PROVENANCE_BYTES = 2**27

# The parts of an origin, the most important first.
_PARTS = ("volume", "device", "scene", "versions")

_MAX_LINE_LENGTH = 200
_MAX_VOXELS = 2**62
_MAX_PROBLEMS = 20

# The names of `golden_file_name`.
GOLDEN_FILE = re.compile(r"frame-([0-9]{4,9})\.png")


def _is_single_line(text: str) -> bool:
    return text.isprintable() and 0 < len(text) <= _MAX_LINE_LENGTH


_LINE = schema.text_field(f"one line of at most {_MAX_LINE_LENGTH} characters", "not a line of text", _is_single_line)


@dataclass(frozen=True)
class Golden:
    """A golden frame. digest: of its file, from `renderer.film.file_digest`. date: given by the user."""

    frame: Annotated[int, FRAME_NUMBER_FIELD]
    file: Annotated[str, _LINE]
    digest: Annotated[str, DIGEST_FIELD]
    date: Annotated[str | None, _LINE] = None


@dataclass(frozen=True)
class Provenance:
    """A record of where the goldens of a folder come from: the content of golden.json.

    origin: what the frames were rendered from: `volume`, `device`, `scene`, `versions`. goldens: ascending, at least
    one.
    """

    origin: Mapping[str, Any]
    goldens: tuple[Golden, ...]


def golden_file_name(frame: int, num_frames: int) -> str:
    """Return `frame-0007.png`, with enough digits to sort the files of the whole path by name."""
    return f"frame-{frame:0{max(4, len(str(num_frames - 1)))}}.png"


def origin_from_record(record: FilmRecord) -> dict[str, Any]:
    """Return the origin of frames from the record of the film that they are.

    It leaves out where the volume lies, and the name, rate and quality of a film: goldens are PNG files.
    """
    assert record.fingerprint is not None, "a single pass has drawn them"
    depends_on, volume = record.fingerprint.depends_on, record.volume
    if "volumes" in record.scene:
        sources: dict[str, Any] = {"volumes": [_without_files(section) for section in record.scene["volumes"]]}
    else:
        sources = {"volume": _without_files(record.scene["volume"])}
    return {
        "volume": {
            "name": short_text(Path(volume.name).name),
            "fingerprint": volume.fingerprint,
            "shape": volume.shape,
            "dtype": volume.dtype,
        },
        "device": short_text(record.device),
        "scene": depends_on["scene"] | sources,
        "versions": {name: short_text(version) for name, version in depends_on["versions"].items()},
    }


def _without_files(volume: Mapping[str, Any]) -> dict[str, Any]:
    rest = _without(volume, "file")
    return rest | ({"raw": _without(rest["raw"], "file")} if "raw" in rest else {})


def _without(mapping: Mapping[str, Any], key: str) -> dict[str, Any]:
    return {other: value for other, value in mapping.items() if other != key}


def describe_changes(before: Mapping[str, Any], now: Mapping[str, Any], *parts: str) -> str:
    """Describe the first few differences of two origins, or of some parts: `scene.error.tolerance was 0.2`.

    The name of the volume is ignored.
    """
    compared = [
        {part: _without(origin[part], "name") if part == "volume" else origin[part] for part in parts or _PARTS}
        for origin in (before, now)
    ]
    return describe_differences(*compared)


def provenance_bytes(provenance: Provenance) -> bytes:
    """Return the content of golden.json, with a line for each golden, for readable diffs."""
    head = json.dumps({"format": FORMAT, **provenance.origin}, indent=2, allow_nan=False)
    frames = ",\n    ".join(json.dumps(record_to_json(golden)) for golden in provenance.goldens)
    return f'{head.removesuffix(_END)},\n  "frames": [\n    {frames}\n  ]{_END}\n'.encode()


_END = "\n}"


def parse_date(text: str | None) -> str | None:
    """Check the value of `--date`, any text of one line. Raises InputError."""
    if text is not None and not _is_single_line(text):
        expected = f"one line of at most {_MAX_LINE_LENGTH} characters, such as 2026-11-21"
        raise InputError("not a date that can be recorded", where="--date", got=format_value(text), expected=expected)
    return text


def read_provenance(folder: Path) -> Provenance:
    """Read golden.json in a folder. Raises InputError, or SceneError with all its problems."""
    path = folder / PROVENANCE_FILE
    content = file_content(path, MAX_PROVENANCE_BYTES, f"a {PROVENANCE_FILE}")
    data = load_json_object(decode_utf8(content, path), path, kind=PROVENANCE_FILE) if may_be_json(content) else {}
    if data.get("format") != FORMAT:
        raise InputError(
            "not a record of goldens that this version of hsplat can read",
            where=str(path),
            got=f"format {format_value(data['format'])}" if "format" in data else None,
            expected=f"format {FORMAT!r}",
            hint="`hsplat golden SCENE FOLDER` writes it; give it a folder without one",
        )
    problems: list[Problem] = []
    node = schema.TreeNode(data, "", problems)
    given = schema.read_fields(node, _TABLE, required=["format", *_PARTS, "frames"])
    if not problems:
        for number, (before, after) in enumerate(pairwise(golden.frame for golden in given["frames"]), 1):
            check_frames_ascend(node.child("frames").child(number).child("frame"), before, after)
    # One mistake may be that of many frames.
    raise_problems(replace(problem, location=str(path)) for problem in problems[:_MAX_PROBLEMS])
    return Provenance({part: given[part] for part in _PARTS}, given["frames"])


def _check_golden(node: schema.TreeNode, given: dict[str, Any]) -> None:
    if schema.valid_keys(given, "frame", "file") == ["frame", "file"]:
        name = GOLDEN_FILE.fullmatch(given["file"])
        if name is None or int(name[1]) != given["frame"]:
            expected = f"frame-{given['frame']:04}.png"
            node.child("file", given["file"]).reject("not the file of this frame", expected=expected)


_VOLUME_TABLE: schema.FieldTable = {
    "name": _LINE,
    "fingerprint": DIGEST_FIELD,
    "shape": schema.sequence_field(
        schema.integer_field(minimum=1, maximum=_MAX_VOXELS), "three numbers of voxels", count=3
    ),
    "dtype": _LINE,
}
_TABLE: schema.FieldTable = {
    "format": _LINE,
    "volume": schema.section_field(_VOLUME_TABLE, lambda _, given: given, required=list(_VOLUME_TABLE)),
    "device": _LINE,
    "scene": schema.MAPPING_FIELD,
    "versions": schema.mapping_field(_LINE),
    "frames": schema.sequence_field(
        schema.dataclass_field(Golden, _check_golden), "a list of one or more frames, each with frame, file and digest"
    ),
}
