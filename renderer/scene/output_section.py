"""The scene's `output`: one file or several of the same drawing, and their sizes; checked against their formats."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any

from renderer.scene import schema
from renderer.scene.colors import COLOR_FIELD
from renderer.scene.input_file import place_name, place_of
from renderer.scene.message_text import did_you_mean, format_value, join_words
from renderer.scene.motion import Motion, at_keys, value_at
from renderer.scene.output_formats import FILM_SUFFIXES, FORMATS, Codec, OutputFormat, format_of, output_suffix
from renderer.scene.picture_kind import Background, PictureKind
from renderer.scene.picture_size import DPI_FIELD, MAX_SIDE, SIZE_FIELD, PaperSize
from renderer.scene.schema import INVALID, KeyText, TreeNode

# The field of a file's name that the frame's number replaces, such as {frame:04}. Zeros before the number fill it to at
# most nine digits, so that names sort in frame order.
FRAME_FIELD = re.compile(r"\{frame(:0[1-9]d?)?\}")

# The keys of an output that choose and set its encoder. An output of another format cannot take them over.
_ENCODER_KEYS = ("codec", "crf", "pixel_format")
# The best quality.
MAX_QUALITY = 10.0
# The coarsest constant rate factor of any encoder.
_MAX_CRF = 63

_FILE_WORDS = (
    f"a {', '.join(FILM_SUFFIXES[:-1])} or {FILM_SUFFIXES[-1]}, frames such as frames/{{frame:04}}.png or .exr or, for "
    "one frame (--frames 7), still.png"
)


def _parse_file(node: TreeNode) -> Any:
    if not schema.is_file_name(node.value):
        return node.reject("not a file name")
    if schema.has_unexpanded_tilde(node.value):
        return node.reject("a folder named ~", hint=schema.TILDE_HINT)
    if os.path.basename(node.value) in ("", ".", ".."):  # `Path` drops such an end
        return node.reject("the output is a folder")
    path = Path(node.value)
    if output_suffix(path) not in FORMATS:
        return node.reject("unknown output format")
    rest, num_fields = FRAME_FIELD.subn("", node.value)
    if num_fields > 1 or "{" in rest or "}" in rest or (num_fields and not FRAME_FIELD.search(path.name)):
        expected = "one {frame} or {frame:04}, in the name of the file, and no other braces"
        return node.reject("not a valid template", expected=expected)
    if num_fields and not format_of(path).is_frames:
        return node.reject(f"a film and frames at once: {output_suffix(path)} with a frame number")
    return path


def _parse_background(node: TreeNode) -> Any:
    if isinstance(node.value, tuple) and len(node.value) == 2:  # a gradient that moves, between two of its keys
        return node.value
    if not isinstance(node.value, Mapping):
        return _COLOR_OR_NONE.parser(node)
    ends = schema.read_fields(node, _GRADIENT, required=_GRADIENT)
    return INVALID if INVALID in ends.values() else (ends["top"], ends["bottom"])


def _gradient_schema(moves: bool) -> schema.JsonSchema:
    ends = {key: replace(field, is_needed=True) for key, field in _GRADIENT.items()}
    return schema.mapping_schema(ends, moves=moves)


def _written_background(background: Background) -> Any:
    """Return a background as it is written in a scene: a word, a color, or a mapping with the ends of a gradient."""
    if background is None:
        return "transparent"
    return dict(zip(_GRADIENT, background, strict=True)) if isinstance(background[0], tuple) else background


OUTPUT_FILE_FIELD = schema.FieldType(_FILE_WORDS, _parse_file, plain_schema=schema.of_json_type("string"))


_BACKGROUND_WORDS = f"{COLOR_FIELD.expected}, transparent, or {{top, bottom}} with two colors"
_COLOR_OR_NONE = schema.word_or({"transparent": None}, COLOR_FIELD, _BACKGROUND_WORDS)
_GRADIENT = {end: schema.described(COLOR_FIELD, f"The color at the {end}.") for end in ("top", "bottom")}
_BACKGROUND = replace(
    _COLOR_OR_NONE,
    parser=_parse_background,
    plain_schema=lambda moves: schema.any_of(_COLOR_OR_NONE.plain_schema(moves), _gradient_schema(moves)),
)
_FRAME = schema.FieldType[Any](
    "a frame, -1 for the last one, or seconds such as 2.5s",
    schema.read_frame,
    plain_schema=lambda _moves: {"type": ["integer", "string"]},
)


@dataclass(frozen=True)
class OutputFile:
    """An output: one file, or a file for each frame, with the size of its pictures and its encoding.

    file: the name, whose suffix determines the format; a template such as `frames/{frame:04}.png` for several pictures.
    background: None is transparent (straight alpha); two colours are a gradient from the top to the bottom.
    quality: from 0 (smallest file) to 10 (best picture), if the encoder has a choice.
    codec, crf, pixel_format: the encoder, its constant rate factor, and ffmpeg's name of a pixel format; None leaves
        them to the format and the quality.
    every: the output shows only frames whose numbers are multiples of `every`.
    frame: the only frame that the output shows; None for all frames.
    dpi: the resolution of the printed picture, in pixels per inch, which PNG, APNG and EXR files state.
    """

    file: Annotated[
        Path,
        OUTPUT_FILE_FIELD,
        KeyText("The file, whose suffix is the format; relative to the current folder.", example="scan.mp4"),
    ]
    size: Annotated[
        tuple[int, int],
        SIZE_FIELD,
        KeyText("Width and height in pixels; or {width: 85 mm, dpi: 300}, in print."),
    ] = (
        512,
        512,
    )
    frames_per_second: Annotated[
        float, schema.number_field(minimum=0.01, maximum=1000, motion=None), KeyText("The frames of a second.")
    ] = 30.0
    background: Annotated[
        Background | Motion[Background],
        _BACKGROUND,
        KeyText("The background: a color, `transparent`, or a gradient such as {top: white, bottom: black}."),
    ] = (0.0, 0.0, 0.0)
    quality: Annotated[
        float,
        schema.number_field(minimum=0, maximum=MAX_QUALITY, motion=None),
        KeyText("From 0, the smallest file, to 10, the best picture."),
    ] = 8.0
    codec: Annotated[
        str | None, schema.TEXT_FIELD, KeyText("The encoder of a film.", "the first of the format", "hevc")
    ] = None
    crf: Annotated[
        float | None,
        schema.number_field(minimum=0, maximum=_MAX_CRF, motion=None),
        KeyText("In place of `quality`: the constant rate factor.", "by quality", "18"),
    ] = None
    pixel_format: Annotated[
        str | None,
        schema.TEXT_FIELD,
        KeyText("The pixel format of ffmpeg.", "the first of the codec", "yuv444p"),
    ] = None
    every: Annotated[
        int,
        schema.integer_field(minimum=1, maximum=schema.MAX_FRAMES),
        KeyText("Of a further file in a list: 2 shows the frames 0, 2, 4 and so on."),
    ] = 1
    frame: Annotated[
        int | None, _FRAME, KeyText("Of a further file in a list: the only frame that it shows.", "all frames", "30")
    ] = None
    dpi: Annotated[
        float | None,
        DPI_FIELD,
        KeyText("The pixels per inch that PNG, APNG and EXR files state.", "none is stated", "300"),
    ] = None

    @property
    def format(self) -> OutputFormat:
        """Return the format of the file."""
        return format_of(self.file)

    @property
    def is_frames(self) -> bool:
        """Return whether each frame is a separate file, which exists as soon as it is drawn."""
        return self.format.is_frames

    def background_at(self, frame: int) -> Background:
        """Return the background as it is at a frame."""
        return value_at(self.background, frame)

    @property
    def is_numbered(self) -> bool:
        """Return whether each frame has a numbered file, so that several jobs may draw different frames of one film."""
        return FRAME_FIELD.search(str(self.file)) is not None

    @property
    def chosen_codec(self) -> Codec:
        """Return the encoder of a film: the scene's choice, or the format's default."""
        codecs = self.format.codecs
        return codecs[self.codec or next(iter(codecs))]

    @property
    def chosen_pixel_format(self) -> str:
        """Return the pixel format: the scene's choice, or the encoder's default."""
        return self.pixel_format or self.pixel_formats[0]

    @property
    def pixel_formats(self) -> tuple[str, ...]:
        """Return the pixel formats that the format and the encoder have for these pictures, the default first."""
        if self.is_frames:
            return self.format.pixel_formats
        return self.chosen_codec.with_alpha if self.background is None else self.chosen_codec.pixel_formats

    @property
    def chosen_crf(self) -> float | None:
        """Return the constant rate factor of a film; None if the encoder has no such factor."""
        of_quality = self.chosen_codec.crf
        if of_quality is None or self.crf is not None:
            return self.crf
        at_zero, per_step = of_quality
        return at_zero - per_step * self.quality

    @property
    def states_dpi(self) -> bool:
        """Return whether files of the format have a place for a resolution."""
        return self.is_frames or self.chosen_codec.has_dpi

    @property
    def kind(self) -> PictureKind:
        """Return the kind of pictures from which the output is made."""
        pixel_format = self.chosen_pixel_format
        depth = 32 if pixel_format == "float" else 16 if pixel_format.endswith(("10", "48")) else 8
        return PictureKind(self.size, self.background, depth, self.dpi)

    def written(self) -> object:
        """Return the section as a scene file has it: its keys with their values."""
        return self._keys()

    def _keys(self) -> dict[str, object]:
        """Return the keys of this file with their values, as a scene file has them.

        `every: 1` is left out, and a dpi that the file cannot state.
        """
        values = {each.name: getattr(self, each.name) for each in fields(OutputFile)}
        values["dpi"] = self.dpi if self.states_dpi else None
        given = {key: value for key, value in values.items() if value is not None and (key, value) != ("every", 1)}
        return given | {"background": at_keys(_written_background, self.background)}

    def shows(self, frame: int) -> bool:
        """Return whether this output shows a frame of the film."""
        return frame % self.every == 0 and self.frame in (None, frame)


@dataclass(frozen=True)
class OutputSpec(OutputFile):
    """A list of output files that one drawing fills. The first of them shows every frame.

    The fields of this class are the keys of the first output. others: all further outputs.
    """

    others: tuple[OutputFile, ...] = ()

    def written(self) -> object:
        """Return the section as a scene file has it: the keys of the only output, or a list of all outputs."""
        return [self._keys(), *self.others] if self.others else self._keys()

    @property
    def files(self) -> tuple[OutputFile, ...]:
        """Return all outputs, in their order."""
        return (self, *self.others)

    @property
    def kinds(self) -> tuple[PictureKind, ...]:
        """Return the kinds of pictures of all outputs, each once; the first output's kind comes first."""
        return tuple(dict.fromkeys(each.kind for each in self.files))

    @property
    def dpi_note(self) -> str | None:
        """Return a note on a dpi that none of the files can state; None without one."""
        without = [each for each in self.files if each.dpi is not None]
        if not without or any(each.states_dpi for each in without):
            return None
        names = join_words([each.file.name for each in without], "and")
        return f"{names} cannot state {without[0].dpi:g} dpi: PNG, APNG and EXR files have a place for it"

    def shown(self, frames: Sequence[int]) -> list[OutputFile]:
        """Return the outputs that show any of these frames."""
        return [each for each in self.files if any(map(each.shows, frames))]

    def kinds_at(self, frame: int) -> tuple[int, ...]:
        """Return the indices in `kinds` of the kinds of pictures that a frame needs."""
        kinds = self.kinds
        return tuple(sorted({kinds.index(each.kind) for each in self.files if each.shows(frame)}))


def _check_file(node: TreeNode, given: dict[str, Any]) -> None:
    """Turn a printed size into pixels, and refuse values that the format of a file does not allow."""
    if isinstance(given.get("size"), PaperSize):
        given["dpi"], given["size"] = _in_pixels(node.child("size"), given["size"], given.get("dpi"))
    if not isinstance(given["file"], Path):
        return
    file_format, rate = format_of(given["file"]), given.get("frames_per_second", INVALID)
    if file_format.max_rate is not None and rate is not INVALID and rate > file_format.max_rate:
        expected = f"at most {file_format.max_rate:g}: viewers slow down faster ones"
        node.child("frames_per_second", rate).reject(f"too fast for {file_format.name}", expected=expected)
    name, named = given.get("codec"), [key for key in ("codec", "crf") if key in given]
    if file_format.is_frames and named:
        node.key(named[0]).reject(f"{file_format.name} have no encoder", expected="")
    elif name is None or name in file_format.codecs:
        _check_pixels(node, given, file_format)
    elif name is not INVALID:
        what, known = f"not an encoder of {output_suffix(given['file'])}", tuple(file_format.codecs)
        node.child("codec", name).reject(what, expected=join_words(known), hint=did_you_mean(name, known))


def _in_pixels(node: TreeNode, size: PaperSize, own: Any) -> tuple[Any, Any]:
    """Return the resolution and the size in pixels of a printed picture; INVALID if it has none.

    node: the node of the size. own: the key `dpi` of the output, None without one.
    """
    dpi = own if size.dpi is None else size.dpi
    if dpi is None:
        node.child("dpi").reject("missing", got="", expected=DPI_FIELD.expected, hint="300 for most journals")
    elif own not in (None, INVALID, dpi):
        node.child("dpi", size.dpi).reject("contradicts output.dpi", expected="one of them")
    elif dpi is not INVALID:
        pixels = size.pixels(dpi)
        if all(1 <= side <= MAX_SIDE for side in pixels):
            return dpi, pixels
        node.reject(
            "out of range", got=f"{pixels[0]} x {pixels[1]} pixels", expected=f"1 to {MAX_SIDE} along each side"
        )
    return dpi, INVALID


def _check_pixels(node: TreeNode, given: dict[str, Any], file_format: OutputFormat) -> None:
    """Refuse a transparent background, a rate factor, a pixel format or a size that the encoder cannot have."""
    codec_name, suffix = given.get("codec"), output_suffix(given["file"])
    is_transparent = given.get("background", INVALID) is None
    output = OutputFile(given["file"], codec=codec_name, background=None if is_transparent else (0.0, 0.0, 0.0))
    formats = output.pixel_formats
    if not formats:
        what = f"a transparent background in {suffix}" + (f" with codec: {codec_name}" if codec_name else "")
        can = [each for each, other in FORMATS.items() if other.has_alpha]
        hint = f"formats that can: {', '.join(can)}" if codec_name is None else "leave codec out"
        node.child("background").reject(what, expected="a color", hint=hint)
        return
    if "crf" in given and output.chosen_codec.crf is None:
        node.key("crf").reject(f"{file_format.name} has no constant rate factor", expected="")
    pixel_format = given.get("pixel_format", formats[0])
    if pixel_format is not INVALID and pixel_format not in formats:
        what = f"not a pixel format of {suffix}{' with alpha' if is_transparent else ''}"
        node.child("pixel_format", pixel_format).reject(what, expected=join_words(formats))
    size = given.get("size", OutputFile.size)
    is_halved = pixel_format is not INVALID and "420" in pixel_format and file_format.filters
    if is_halved and size is not INVALID and INVALID not in size and any(side % 2 for side in size):
        hint = f"the nearest is {[side + side % 2 for side in size]}"
        what = f"odd sizes cannot be encoded as {file_format.name.split()[-1]}"
        node.child("size", size).reject(what, expected="even numbers", hint=hint)


_FILE = schema.dataclass_field(OutputFile, _check_file)
# The keys that further outputs take from the first one, unless they have their own.
_SHARED_KEYS = ("size", "dpi", "background")


def _parse_output(node: TreeNode) -> Any:
    """Return the outputs that a section `output` describes, with one output or a list of them, or INVALID."""
    nodes = [node]
    if isinstance(node.value, (list, tuple)):
        nodes = [node.child(number, each) for number, each in enumerate(node.value)]
    if not nodes:
        return node.reject("an empty list", got="", expected="one file or more")
    num_problems, (node, *others) = len(node.problems), nodes
    for key in filter(node.value.__contains__, ("every", "frame")) if isinstance(node.value, Mapping) else ():
        node.key(key).reject("not for the first output", expected="", hint="it has all frames")
    first = _FILE.read(node)
    wrong, shared = [each.path for each in node.problems[num_problems:]], {}
    if isinstance(node.value, Mapping):
        right = [key for key in _SHARED_KEYS if not any(f"{node.path}.{key}" in path for path in wrong)]
        shared = {key: node.value[key] for key in right if key in node.value}
    files = [] if wrong else [(node, first)]
    for each in others:
        before = len(node.problems)
        if isinstance(each.value, Mapping):
            own = {key: value for key, value in shared.items() if key != "dpi" or "size" not in each.value}
            other = _FILE.read(replace(each, value={**own, **each.value}))
        else:
            other = _FILE.read(each)
        if len(node.problems) == before:
            files.append((each, other if wrong else _beside(first, other, each)))
    _check_names(files)
    if len(node.problems) > num_problems:
        return first
    own = {each.name: getattr(first, each.name) for each in fields(OutputFile)}
    return OutputSpec(**own, others=tuple(other for _, other in files[1:]))


def _beside(first: OutputFile, other: OutputFile, node: TreeNode) -> OutputFile:
    """Return an output after the first one with its frame rate and its printed size.

    A size that does not divide the first one's is refused. Unless the rate is given, the film of every n-th frame has
    an n-th of the first output's rate, so that both films take equally long.
    """
    factor = first.size[0] // other.size[0]
    if factor < 1 or tuple(factor * side for side in other.size) != first.size:
        smaller = [[side // k for side in first.size] for k in range(1, 9) if not any(side % k for side in first.size)]
        node.child("size", list(other.size)).reject(
            "not a whole divisor of the first output's size",
            expected=f"{format_value(list(first.size))}, or both divided by one whole number",
            hint=f"such as {', '.join(map(format_value, smaller))}",
        )
    if other.dpi is None and first.dpi is not None:
        other = replace(other, dpi=first.dpi * other.size[0] / first.size[0])
    if isinstance(node.value, Mapping) and "frames_per_second" in node.value:
        return other
    slower = first.frames_per_second / other.every
    return replace(other, frames_per_second=min(slower, other.format.max_rate or slower))


def _check_names(files: Iterable[tuple[TreeNode, OutputFile]]) -> None:
    """Refuse outputs whose files may have the same name."""
    known = list[tuple[str, str]]()
    for node, each in files:
        name = os.path.join(place_of(each.file.parent), place_name(each.file.name))
        pattern = r"\d+".join(map(re.escape, FRAME_FIELD.split(name)[::2]))
        example = FRAME_FIELD.sub("0", name)
        if any(re.fullmatch(other, example) or re.fullmatch(pattern, one) for other, one in known):
            node.child("file", str(each.file)).reject("the name of two outputs", expected="another name")
        known.append((pattern, example))


_FILES = schema.sequence_field(_FILE, "a list of files")
OUTPUT_SECTION = schema.FieldType(
    "a mapping with file, or a list of such",
    _parse_output,
    table=_FILE.table,
    plain_schema=schema.either(_FILE, _FILES),
    example=_FILE.example,
)


def check_frame_field(node: TreeNode, given: Mapping[str, Any]) -> None:
    """Check that the file name of an output with a file for each of several frames has a field for their numbers.

    given: the sections of the whole scene.
    """
    camera, output = given["camera"], given["output"]
    num_frames = getattr(getattr(camera, "path", None), "frames", INVALID)
    if num_frames is INVALID or not isinstance(output, OutputFile) or output.file is INVALID:
        return
    files = output.files if isinstance(output, OutputSpec) else (output,)
    for k, each in enumerate(files):
        place = node.child(k) if len(files) > 1 else node
        is_one = camera.num_frames <= each.every or each.frame is not None
        if each.is_frames and not each.is_numbered and not is_one:
            hint = f"write {each.file.stem}-{{frame:04}}{each.file.suffix}" + ", or frame: 0 for one frame" * (k > 0)
            place.child("file", str(each.file)).reject(
                "frames need a number in their names", expected=_FILE_WORDS, hint=hint
            )


def outputs_of(scene: Mapping[str, Any]) -> Sequence[dict[str, Any]]:
    """Return the outputs of a scene in plain data, which `parse_scene` has accepted."""
    return scene["output"] if isinstance(scene["output"], (list, tuple)) else [scene["output"]]


def first_output(scene: Mapping[str, Any]) -> dict[str, Any]:
    """Return the first output of a scene in plain data, which `parse_scene` has accepted."""
    return outputs_of(scene)[0]


def only_output(section: Any, suffix: str) -> Any:
    """Return the first output of an `output` section in plain data, whose file is to be replaced by a new one.

    suffix: the suffix of the new file. If it has another format, the keys of the encoder are left out.
    """
    first = section[0] if isinstance(section, list) and section else section
    if not isinstance(first, dict) or output_suffix(str(first.get("file"))) == suffix:
        return first
    return {key: value for key, value in first.items() if key not in _ENCODER_KEYS}
