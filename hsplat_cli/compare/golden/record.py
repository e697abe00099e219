"""Define golden.json: the golden pictures of a film's frames, and what drew each of them.

The file has no times, so equal goldens give equal bytes. Anybody may have edited it: its texts are accepted only if
they are safe to print, and its file names only if they stay in the folder.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

from renderer.film import Pixels
from renderer.record import RecordFile, differences, field_types as types, record_to_json
from renderer.scene import schema, short_text

GOLDEN_RECORD_FILE = "golden.json"
# Matches the file names that `golden_file_name` returns. The groups are the numbers of the frame and of the picture.
GOLDEN_FILE = re.compile(r"frame-([0-9]{4,9})(?:-([2-9]))?\.png")
# A Python slice of frames, or the number of one.
_SLICE = re.compile(r"-?[0-9]{1,9}|(?:-?[0-9]{1,9})?:(?:-?[0-9]{1,9})?(?::(?:[1-9][0-9]{0,8})?)?")
# The slice of all frames.
ALL_FRAMES = ":"
# The most pictures of a frame: names of files have one digit for them.
MOST_PICTURES = 9


def _parse_slice(node: schema.TreeNode) -> Any:
    text = str(node.value) if type(node.value) is int else node.value
    short = text.replace(" ", "") if isinstance(text, str) else ""
    return short if _SLICE.fullmatch(short) else node.reject("not a range of frames")


SLICE_FIELD: schema.FieldType[str] = schema.FieldType("a Python slice such as ::10, or one number", _parse_slice)


@dataclass(frozen=True)
class GoldenVolume:
    """The volume that goldens show. fingerprint: the digest of its voxels."""

    name: Annotated[str, types.LINE]
    fingerprint: Annotated[str, types.DIGEST]
    shape: Annotated[tuple[int, int, int], types.SHAPE]
    dtype: Annotated[str, types.LINE]


@dataclass(frozen=True)
class Origin:
    """What drew goldens: the inputs that they depend on, and the programs.

    device: the device that drew the frames. scene: the scene as data, without the paths of files. versions: the
    versions of the programs, by name.
    """

    volume: GoldenVolume
    device: Annotated[str, types.LINE]
    scene: Annotated[Mapping[str, Any], types.DATA]
    versions: Annotated[Mapping[str, str], types.LINES]

    @property
    def inputs(self) -> dict[str, Any]:
        """Return the scene and the voxels, as data; volumes of different names may be equal."""
        data = record_to_json(self)
        volume = {key: value for key, value in data["volume"].items() if key != "name"}
        return {"scene": data["scene"], "volume": volume}

    def changes(self, now: Origin) -> list[tuple[str, Any, Any]]:
        """Return the keys of scene and volume in which another origin differs, such as `scene.error.tolerance`.

        Each with the value here and there; None for a missing value.
        """
        return [*differences(self.inputs, now.inputs)]


@dataclass(frozen=True)
class GoldenPicture:
    """A golden picture of a frame.

    digest: the digest of its pixels, by `picture_digest`. origin: the index of its origin. file: its file; None for a
    golden of which only the digest is kept. psnr: the accuracy that it states, in dB, if it states one.
    """

    digest: Annotated[str, types.DIGEST]
    origin: Annotated[int, types.COUNT]
    file: Annotated[str | None, types.LINE] = None
    psnr: Annotated[float | None, types.DECIBELS] = None


def _check_golden(node: schema.TreeNode, given: dict[str, Any]) -> None:
    if schema.valid_keys(given, "frame", "pictures") != ["frame", "pictures"]:
        return
    if len(given["pictures"]) > MOST_PICTURES:
        node.child("pictures").reject("too many pictures", expected=f"at most {MOST_PICTURES}")
    for name in (picture.file for picture in given["pictures"]):
        if name is None or name is schema.INVALID:
            continue
        found = GOLDEN_FILE.fullmatch(name)
        if found is None or int(found[1]) != given["frame"]:
            expected = f"frame-{given['frame']:04}.png"
            node.child("pictures").reject("not a file of this frame", expected=expected)


@dataclass(frozen=True)
class Golden:
    """The golden pictures of a frame: another picture passes if it is like one of them."""

    frame: Annotated[int, types.FRAME]
    pictures: Annotated[
        tuple[GoldenPicture, ...], schema.sequence_field(schema.dataclass_field(GoldenPicture), "a list of pictures")
    ]

    @property
    def files(self) -> list[str]:
        """Return the names of the files of the pictures."""
        return [picture.file for picture in self.pictures if picture.file is not None]

    @property
    def free_number(self) -> int:
        """Return the number of the next picture, by which its file is named; larger than MOST_PICTURES if all are."""
        used = {int(name[2] or 1) for name in map(GOLDEN_FILE.fullmatch, self.files) if name is not None}
        return min(set(range(1, len(self.pictures) + 2)) - used)


def _check_record(node: schema.TreeNode, given: dict[str, Any]) -> None:
    if schema.valid_keys(given, "origins", "frames") != ["origins", "frames"]:
        return
    pictures = [picture for golden in given["frames"] for picture in golden.pictures]
    if any(picture.origin >= len(given["origins"]) for picture in pictures):
        node.child("frames").reject("a picture has an origin that is not in the list `origins`")
    files = [file for golden in given["frames"] for file in golden.files]
    if len(set(files)) < len(files):
        node.child("frames").reject("two pictures have the same file")


_FRAMES = types.frames(
    schema.dataclass_field(Golden, _check_golden), "a list of one or more frames, each with frame and pictures"
)


@dataclass(frozen=True)
class GoldenRecord:
    """The content of golden.json.

    origins: what drew the pictures. selection: the Python slice of the film's frames that should have goldens; a film
    that grows has more of them. flicker: the flicker of the film, in levels of 8 bits, if neighbouring frames are
    golden. frames: the goldens, in ascending order.
    """

    origins: Annotated[tuple[Origin, ...], schema.sequence_field(schema.dataclass_field(Origin), "a list of origins")]
    frames: Annotated[tuple[Golden, ...], _FRAMES]
    selection: Annotated[str, SLICE_FIELD]
    flicker: Annotated[float | None, types.AMOUNT] = None

    @property
    def files(self) -> set[str]:
        """Return the names of all files."""
        return {file for golden in self.frames for file in golden.files}

    @cached_property
    def by_frame(self) -> dict[int, Golden]:
        """Return the goldens by the numbers of their frames."""
        return {golden.frame: golden for golden in self.frames}


GOLDEN_RECORD = RecordFile(
    schema.dataclass_field(GoldenRecord, _check_record),
    noun=f"a {GOLDEN_RECORD_FILE}",
    max_bytes=2**27,  # enough for half a million goldens of about 200 bytes each
    format_line="hsplat golden 3",
    hint="`hsplat golden` writes it; remove the folder of goldens, and make them again",
    lined="frames",
)


def golden_file_name(frame: int, num_frames: int, number: int = 1) -> str:
    """Return the name of a golden's file, such as `frame-0007.png`, or `frame-0007-2.png` for the second picture.

    It has enough digits to sort the files of all frames by name.
    """
    digits = max(4, len(str(num_frames - 1)))
    return f"frame-{frame:0{digits}}{f'-{number}' if number > 1 else ''}.png"


def picture_digest(picture: Pixels) -> str:
    """Return the digest of the size and the stored values of a picture, however its file is compressed."""
    digest = hashlib.blake2b(repr(picture.shape).encode("ascii"), digest_size=16)
    digest.update(picture.tobytes())
    return digest.hexdigest()


def make_origin(
    depends_on: Mapping[str, Any], tree: Mapping[str, Any], name: str, shape: tuple[int, int, int], dtype: str
) -> Origin:
    """Return the origin of frames.

    It leaves out the volume's path, and the film's name, frame rate and quality: they do not change goldens, which are
    PNG files.

    depends_on: as in FilmFingerprint. tree: the scene as data. name, shape, dtype: of the first volume.
    """
    if "volumes" in tree:
        sources: dict[str, Any] = {"volumes": [_without_files(section) for section in tree["volumes"]]}
    else:
        sources = {"volume": _without_files(tree["volume"])}
    return Origin(
        GoldenVolume(short_text(Path(name).name), depends_on["volume"]["fingerprint"], shape, dtype),
        short_text(depends_on["device"]),
        depends_on["scene"] | sources,
        {name: short_text(version) for name, version in depends_on["versions"].items()},
    )


def _without_files(volume: Mapping[str, Any]) -> dict[str, Any]:
    rest = {key: value for key, value in volume.items() if key != "file"}
    if "raw" in rest:
        rest["raw"] = {key: value for key, value in rest["raw"].items() if key != "file"}
    return rest
