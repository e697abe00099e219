"""Read and write golden.json: the frames in a folder of goldens, and their origin.

The file has no times, so equal goldens give equal bytes. The file may have been edited by hand: its texts are accepted
only if they are safe to print, and its file names only if they stay in the folder.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from renderer.errors import InputError
from renderer.record import FilmRecord, RecordFile, describe_differences, field_types as types, record_to_json
from renderer.scene import format_value, schema, short_text

PROVENANCE_FILE = "golden.json"

# The fields of a GoldenOrigin that are compared, the most important first: messages name changes in this order.
_PARTS = ("volume", "device", "scene", "versions")

# Matches the file names that `golden_file_name` returns. Its group is the number of the frame.
GOLDEN_FILE = re.compile(r"frame-([0-9]{4,9})\.png")


@dataclass(frozen=True)
class Golden:
    """A golden frame: a picture with which later pictures of the frame are compared.

    digest: the digest of the picture's file, from `renderer.film.file_digest`. date: the text of `--date`, if any.
    """

    frame: Annotated[int, types.FRAME]
    file: Annotated[str, types.LINE]
    digest: Annotated[str, types.DIGEST]
    date: Annotated[str | None, types.LINE] = None


@dataclass(frozen=True)
class GoldenVolume:
    """The volume that the goldens of a folder show. fingerprint: the digest of its voxels."""

    name: Annotated[str, types.LINE]
    fingerprint: Annotated[str, types.DIGEST]
    shape: Annotated[tuple[int, int, int], types.SHAPE]
    dtype: Annotated[str, types.LINE]


@dataclass(frozen=True)
class GoldenOrigin:
    """The origin of goldens: the inputs that they were rendered from, and the programs that rendered them.

    device: the device that drew the frames. scene: the scene as data, without the paths of files. versions: the
    versions of the programs, by name.
    """

    volume: GoldenVolume
    device: Annotated[str, types.LINE]
    scene: Annotated[Mapping[str, Any], types.DATA]
    versions: Annotated[Mapping[str, str], types.LINES]

    def changes(self, now: GoldenOrigin, *parts: str) -> str:
        """Return the first few changes from this origin to `now` as text: `scene.error.tolerance was 0.1`.

        parts: the fields that are compared, by default all of them. The name of the volume is ignored.
        """
        return describe_differences(self._compared(parts or _PARTS), now._compared(parts or _PARTS))

    def _compared(self, parts: Sequence[str]) -> dict[str, Any]:
        data = record_to_json(self)
        data["volume"] = _without(data["volume"], "name")
        return {part: data[part] for part in parts}


def _check_golden(node: schema.TreeNode, given: dict[str, Any]) -> None:
    if schema.valid_keys(given, "frame", "file") == ["frame", "file"]:
        name = GOLDEN_FILE.fullmatch(given["file"])
        if name is None or int(name[1]) != given["frame"]:
            expected = f"frame-{given['frame']:04}.png"
            node.child("file", given["file"]).reject("not the file of this frame", expected=expected)


_FRAMES = types.frames(
    schema.dataclass_field(Golden, _check_golden), "a list of one or more frames, each with frame, file and digest"
)


@dataclass(frozen=True)
class Provenance(GoldenOrigin):
    """The content of golden.json: the goldens of a folder, in ascending order of frames, and their common origin."""

    frames: Annotated[tuple[Golden, ...], _FRAMES]


PROVENANCE = RecordFile(
    schema.dataclass_field(Provenance),
    noun=f"a {PROVENANCE_FILE}",
    max_bytes=2**27,  # enough for a million goldens of about 120 bytes each
    format_line="hsplat golden 2",
    hint="`hsplat golden SCENE FOLDER` writes it; give it a folder without one",
    lined="frames",
)


def golden_file_name(frame: int, num_frames: int) -> str:
    """Return a golden's file name, such as `frame-0007.png`, with enough digits to sort all frames' files by name."""
    return f"frame-{frame:0{max(4, len(str(num_frames - 1)))}}.png"


def origin_from_record(record: FilmRecord) -> GoldenOrigin:
    """Return the origin of frames from the record of the film that they belong to.

    The origin leaves out the volume's path, and the film's name, frame rate and quality: they do not change goldens,
    which are PNG files.
    """
    assert record.fingerprint is not None, "a single pass has drawn them"
    depends_on, volume = record.fingerprint.depends_on, record.volume
    if "volumes" in record.scene:
        sources: dict[str, Any] = {"volumes": [_without_files(section) for section in record.scene["volumes"]]}
    else:
        sources = {"volume": _without_files(record.scene["volume"])}
    return GoldenOrigin(
        GoldenVolume(short_text(Path(volume.name).name), volume.fingerprint, volume.shape, volume.dtype),
        short_text(record.device),
        depends_on["scene"] | sources,
        {name: short_text(version) for name, version in depends_on["versions"].items()},
    )


def _without_files(volume: Mapping[str, Any]) -> dict[str, Any]:
    rest = _without(volume, "file")
    return rest | ({"raw": _without(rest["raw"], "file")} if "raw" in rest else {})


def _without(mapping: Mapping[str, Any], key: str) -> dict[str, Any]:
    return {other: value for other, value in mapping.items() if other != key}


def parse_date(text: str | None) -> str | None:
    """Return the value of `--date`, which may be any text of one line. Raises InputError for other texts."""
    if text is not None and not types.is_line(text):
        expected = f"{types.LINE_TEXT}, such as 2026-11-21"
        raise InputError("not a date that can be recorded", where="--date", got=format_value(text), expected=expected)
    return text
