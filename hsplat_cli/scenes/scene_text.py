"""Suggests a scene that shows a volume, and writes it as text.

The text is made to be changed by hand: its sections are in a natural order, and comments explain them.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, TypeVar

from hsplat_cli.scenes.volume_arguments import read_with_options
from hsplat_cli.scenes.volume_names import name_volumes, own_name
from hsplat_cli.terminal import Reporter
from renderer.errors import InputError, Problem, SceneError
from renderer.scene import (
    AXES,
    ENVIRONMENTS,
    Color,
    ColormapSpec,
    EnvironmentSpec,
    LabelsSpec,
    LightSpec,
    RawSource,
    ShadingSpec,
    TransferSpec,
    UrlSource,
    VolumeSpec,
    format_value,
    is_url,
    parse_scene_content,
    parse_yaml,
    relative_path,
    spec_to_dict,
)
from renderer.system import printable

if TYPE_CHECKING:
    from renderer.suggest import FilmOptions, Suggestion, VolumeSuggestion
    from renderer.volume import Volume

# The type of the path of a volume: a file, or a list of the files of steps in time.
FileOrFiles = TypeVar("FileOrFiles", str, list[str])

# Column at which a comment behind a value begins, unless the line is longer.
_COMMENT_COLUMN = 30

SCENE_HINT = (
    "Change anything: `hsplat check` looks for mistakes, `hsplat explain` lists all sections, and `hsplat explain KEY` "
    "the keys of one."
)
_ANNOTATION_COMMENT = (
    "remove the first # to draw it, in room beside the object; `layout: over` draws it over the object"
)
_VOLUME_COMMENT = "a path from the folder of this file"
_FILM_COMMENT = "a path from the folder in which hsplat is run, not from that of this file"
_TRANSFER_COMMENT = (
    "# The look of each value. An opacity is the share of light that one `unit` of length holds back: 0 none, 1 all."
)
_SHADING_COMMENT = (
    "# Darker where a surface faces away from the light, which turns with the object. Delete it for even light."
)
_LIGHT_COMMENT = "# Light of surroundings, and of a lamp that turns with the object; matter and surfaces scatter it."
_CLIP_COMMENT = "# Planes that clip away everything but the object, such as a table; delete them to see all of it."
_LABELS_COMMENT = "# Which labels are shown, by number or by name, and how: `hide: [...]` leaves some out."

_CHANNELS_COMMENT = (
    "# Each channel of the file, in its colour: dark at the first value of its range, brightest at the second."
)

# The kind of a volume whose voxels all have one value: its film shows nothing but its box.
_CONSTANT = "constant volume"

# Keys of the section `shading` that are written even if they have their defaults.
_ALWAYS_SHOWN = ("ambient", "diffuse", "light")

# The option of the command line that gives a value of the scene, by the value's key.
_OPTIONS = {
    "volume.spacing": "--spacing",
    "volumes.0.spacing": "--spacing",
    "volume.raw.spacing": "--spacing",
    "light": "--light",
    "output.background": "--background",
    "output.size": "--size",
    "output.frames_per_second": "--fps",
    "output.file": "the name of the film",
}


def suggest_scene(
    volume: VolumeSpec, film: FilmOptions, reporter: Reporter, *, scene: Path, output: Path
) -> tuple[str, VolumeSuggestion]:
    """Return a suggested scene for the file `scene`, as YAML, and the suggestion; report the kind of the volume.

    Raises InputError for a volume that cannot be read or drawn, and SceneError for an option, such as the background,
    that cannot be in a scene.
    """
    from renderer.suggest import NO_LIGHT, Wish, suggest_for, suggest_over, with_light

    def read(spec: VolumeSpec) -> Volume:
        """Read a volume, and print the reader's notes once for all of its channels and steps."""
        is_other = spec.source == volume.source and (
            spec.component not in ("all", 0, volume.component) or spec.time not in (0, volume.time)
        )
        return read_with_options(spec, replace(reporter, is_quiet=True) if is_other else reporter, in_time=True)

    wish, under = Wish(film.colormap, film.preset), None
    if film.under is None:
        found = suggest_for(volume, read, wish=wish)
    else:
        found, under = suggest_over(volume, film.under, read, wish=wish)
    if film.light != NO_LIGHT:
        _require_one_layer(found, under, film.light)
        found = replace(found, suggestion=with_light(found.suggestion, film.light))
    text = compose_scene(found, film, folder=scene.parent, output=output, under=under)
    _check(text, scene)
    for each in filter(None, (found, under)):
        chosen, name = each.suggestion, volume_place(each.volume)
        is_constant = chosen.kind == _CONSTANT
        first = f"{'warning: ' * is_constant}{chosen.kind}; {chosen.reason}"
        (reporter.warning if is_constant else reporter.status)(f"{name}: {first}")
        for line in chosen.outlier_notes:
            reporter.status(f"{name}: {line}")
    return text, found


def _require_one_layer(found: VolumeSuggestion, under: VolumeSuggestion | None, light: str) -> None:
    """Raise InputError for several layers, which are suggested without a light that matter scatters."""
    what = "the light of channels adds up, and no matter scatters it" if found.layers else ""
    if under is not None:
        what = "a shell around another volume is seen by its shading, which light replaces"
    if what:
        raise InputError(what, where=f"--light {light}", hint="--light none")


def _check(text: str, scene: Path) -> None:
    """Raise SceneError for values that no scene may have, such as odd sizes of an MP4.

    The error names the options that gave the values, and not lines of the scene, which is not written yet.
    """
    try:
        parse_scene_content(text.encode(), scene)
    except SceneError as error:
        raise SceneError([_at_option(problem) for problem in error.problems]) from error


def _at_option(problem: Problem) -> Problem:
    location = _OPTIONS.get(problem.path, "the scene that was suggested")
    return replace(problem, what=problem.what.partition("\n")[0], location=location)


def compose_scene(
    found: VolumeSuggestion, film: FilmOptions, *, folder: Path, output: Path, under: VolumeSuggestion | None = None
) -> str:
    """Return the scene of a turntable as YAML.

    found: the suggestion; the path of its volume is relative to the current folder. folder: the folder of the scene's
    file; the scene names its volume relative to it. output: the path of the film, relative to the current folder.
    under: the suggestion for the volume underneath.
    """
    elevation, about = format_value(film.elevation), [*_about(found)]
    subject = (_channel_lines if found.layers else _one_volume_lines)(found, folder)
    if under is not None:
        subject = _volumes_lines(found, under, folder)
        about = [f"{_name(found)} over {_name(under)}.", *about, *_about(under)]
    lines = [
        f"# A turntable of {about[0]}",
        *(f"# {line}" for line in about[1:]),
        f"# {SCENE_HINT}",
        "version: 1",
        "",
        *subject,
        *_light_lines(found.suggestion.light, film.axis),
        "",
        "camera:",
        "  target: visible             # the middle of the visible part; as near as shows all of it",
        f"  path: {{type: turntable, frames: {film.frames}, elevation: {elevation}, axis: {film.axis}}}",
        "",
        "error:",
        _with_comment(
            f"  tolerance: {format_value(film.tolerance)}",
            "smaller is more exact and slower, 0 draws every visible voxel",
        ),
        "",
        f"# annotation: {{{_annotation(found)}}}  # {_ANNOTATION_COMMENT}",
        "",
        "output:",
        _with_comment(f"  file: {yaml_string(output)}", "" if output.is_absolute() else _FILM_COMMENT),
        f"  size: [{film.size[0]}, {film.size[1]}]",
        f"  frames_per_second: {format_value(film.fps)}",
        f"  background: {yaml_string(film.background)}",
    ]
    return "\n".join(lines) + "\n"


def _annotation(found: VolumeSuggestion) -> str:
    """Return the entries of an annotation that suit what is shown, for a line that is a comment."""
    if found.suggestion.transfer.labels is not None:
        return "names: true"
    if found.volume.has_colors:
        return "scale_bar: true"
    colors = "legend: {position: top-left}" if found.layers else "color_bar: true"
    return f"{colors}, scale_bar: true"


def _name(found: VolumeSuggestion) -> str:
    return printable(own_name(volume_place(found.volume)))


def _about(found: VolumeSuggestion) -> Iterator[str]:
    yield f"{_name(found)}: {found.suggestion.kind};"
    yield f"{found.suggestion.reason}."
    yield from (f"{note}." for note in found.suggestion.outlier_notes)


def _one_volume_lines(found: VolumeSuggestion, folder: Path) -> Iterator[str]:
    suggestion = found.suggestion
    yield "volume:"
    yield from (f"  {line}" for line in _volume_lines(found.volume, folder, has_absent=found.has_absent))
    yield from ("", _LABELS_COMMENT if suggestion.transfer.labels else _TRANSFER_COMMENT)
    yield from look_lines(suggestion)


def look_lines(suggestion: Suggestion) -> Iterator[str]:
    """Yield the lines of the sections on the look of a volume: colours and opacities, shading, and clip planes."""
    yield from transfer_lines(suggestion.transfer, suggestion.notes)
    yield from _shading_lines(suggestion)


def _volumes_lines(upper: VolumeSuggestion, lower: VolumeSuggestion, folder: Path) -> Iterator[str]:
    """Yield the lines of the section `volumes` for one volume over another."""
    yield from (_TRANSFER_COMMENT, "volumes:")
    names = name_volumes([volume_place(upper.volume), volume_place(lower.volume)])
    for number, (found, name) in enumerate(zip((upper, lower), names, strict=True)):
        suggestion = found.suggestion
        yield from [""] * number
        yield f"  - name: {yaml_string(name)}"
        section = [*_volume_lines(found.volume, folder, has_absent=found.has_absent)]
        section += [_with_comment(f"weight: {format_value(found.weight)}", "a factor on how dense it is", indent=2)]
        section += [*filter(None, look_lines(suggestion))]
        yield from (f"    {line}" for line in section)


def volume_place(volume: VolumeSpec) -> Path | str:
    """Return the file, the folder or the URL of a volume; for steps in time the file that lists them, or the first."""
    if isinstance(volume.source, UrlSource):
        return volume.source.url
    file = getattr(volume.source, "collection", None) or getattr(volume.source, "file", None)
    assert isinstance(file, Path), volume.source
    return file


def _channel_lines(found: VolumeSuggestion, folder: Path) -> Iterator[str]:
    yield from (_CHANNELS_COMMENT, "volumes:")
    for layer in found.layers:
        assert layer.color is not None and layer.range is not None
        lines = [*_volume_lines(layer.volume, folder, has_absent=found.has_absent)]
        lines += [f"name: {yaml_string(layer.name)}"] * bool(layer.name)
        lines += [f'color: "{_hex_color(layer.color)}"', f"range: {_list(layer.range)}"]
        lines += [f"weight: {format_value(layer.weight)}"] * (layer.weight != 1.0)
        yield from (f"  {' ' if number else '-'} {line}" for number, line in enumerate(lines))
    yield _with_comment("blend: add", "light adds up, as in fluorescence; mix: colours hide each other")


def place_in(folder: Path, file: FileOrFiles) -> FileOrFiles:
    """Return a file, or a list of files, as a scene in `folder` names it: relative to `folder`, unless absolute."""
    if isinstance(file, list):
        return [place_in(folder, each) for each in file]
    return file if os.path.isabs(file) else relative_path(file, folder)


def _volume_lines(volume: VolumeSpec, folder: Path, *, has_absent: bool) -> Iterator[str]:
    source, written = volume.source, place_in(folder, spec_to_dict(volume.source)["file"])
    place = f"[{', '.join(map(yaml_string, written))}]" if isinstance(written, list) else yaml_string(written)
    if isinstance(source, RawSource):
        yield f"raw: {{file: {place}, shape: {list(source.shape)}, dtype: {yaml_string(source.dtype)},"
        yield f"      byte_order: {source.byte_order}, spacing: {_list(source.spacing)}, offset: {source.offset}}}"
    else:
        is_whole = os.path.isabs(written if isinstance(written, str) else written[0])
        comment = "a store" if is_url(written) else "" if is_whole else _VOLUME_COMMENT
        yield _with_comment(f"file: {place}", comment, indent=2)
        if (spacing := getattr(source, "spacing", None)) is not None:
            yield _with_comment(f"spacing: {_list(spacing)}", "size of a voxel, in place of the file's", indent=2)
    for key in ("time", "component"):
        if (index := getattr(volume, key)) is not None:
            all_steps = "all steps over the film; or a map from frames to steps: {0: 0, 30: 7}"
            yield _with_comment(f"{key}: auto", all_steps, indent=2) if index == "auto" else f"{key}: {index}"
    if volume.dataset is not None:
        yield f"dataset: {yaml_string(volume.dataset)}"
    if volume.level is not None:
        yield _with_comment(f"level: {volume.level}", "of the store, 0 the finest", indent=2)
    if has_absent or volume.nodata != "auto":
        nodata = volume.nodata if isinstance(volume.nodata, str) else _list(volume.nodata)
        yield _with_comment(
            f"nodata: {nodata}", "values without data, as NaN is: auto (fill values), none, or numbers", indent=2
        )


def transfer_lines(transfer: TransferSpec, notes: Sequence[str] = ()) -> Iterator[str]:
    """Yield the lines of the section `transfer_function`, or `labels`. notes: a comment for each control point."""
    mapping = transfer.mapping
    yield "labels:" if isinstance(mapping, LabelsSpec) else "transfer_function:"
    if transfer.unit is not None:
        yield f"  unit: {format_value(transfer.unit)}"
    if isinstance(mapping, LabelsSpec):
        yield from _label_lines(mapping)
        return
    if isinstance(mapping, ColormapSpec):
        yield f"  colormap: {yaml_string(mapping.colormap)}"
        yield f"  range: {_list(mapping.range)}"
        if mapping.scale is not None:
            yield _with_comment(f"  scale: {mapping.scale}", "even steps of the logarithm; or linear")
        yield "  opacity:"
        yield from (f"    - {_list(pair)}" for pair in mapping.opacity)
        return
    yield "  points:"
    for k, point in enumerate(transfer.points):
        value, color, opacity = format_value(point.value), _hex_color(point.color), format_value(point.opacity)
        note = f"  # {notes[k]}" if k < len(notes) and notes[k] else ""
        yield f'    - {{value: {value}, color: "{color}", opacity: {opacity}}}{note}'


def _label_lines(labels: LabelsSpec) -> Iterator[str]:
    """Yield the lines of the section `labels` below its first line: numbers, opacities, colours and names."""
    styles = labels.styles
    flow = ", ".join(str(style.value) for style in styles)
    yield from wrap(f"[{flow}]", 100, initial_indent="  show: ", subsequent_indent="         ")
    if len({style.opacity for style in styles}) == 1:
        yield f"  opacity: {format_value(styles[0].opacity)}"
    else:
        yield from ("  opacity:", *(f"    {style.value}: {format_value(style.opacity)}" for style in styles))
    yield from ("  colors:", *(f'    {style.value}: "{_hex_color(style.color)}"' for style in styles))
    if any(style.name for style in styles):
        yield from ("  names:", *(f"    {style.value}: {yaml_string(style.name)}" for style in styles if style.name))


def _light_lines(light: LightSpec | None, axis: str) -> Iterator[str]:
    """Yield the lines of the section `light`. axis: the word for the axis that is upright in the picture."""
    if light is None:
        return
    from renderer.view import rotation_from_z_to

    turn = rotation_from_z_to(AXES[axis])
    given = {"environment": _environment_text(light.environment)}
    if axis != "z":
        given["up"] = _list(AXES[axis])
    if light.key is not None:
        assert not isinstance(light.key.direction, str), "suggested lamps are fixed to the object"
        direction = [round(each, 6) + 0.0 for each in (turn @ light.key.direction).tolist()]
        lamp = f'direction: {_list(direction)}, color: "{_hex_color(light.key.color)}"'
        lamp += f", strength: {format_value(light.key.strength)}, radius: {format_value(light.key.radius)}"
        given["key"] = f"{{{lamp}}}"
    if light.surface > 0:
        given |= {key: format_value(getattr(light, key)) for key in ("surface", "specular")}
    yield from ("", _LIGHT_COMMENT, "light:", *(f"  {key}: {value}" for key, value in given.items()))


def _environment_text(environment: EnvironmentSpec) -> str:
    """Return the name of an environment."""
    return next(name for name, each in ENVIRONMENTS.items() if each == environment)


def _shading_lines(suggestion: Suggestion) -> Iterator[str]:
    """Yield the lines of the sections `shading` and `clip`."""
    if (shading := suggestion.shading) is not None:
        yield from ("", _SHADING_COMMENT, f"shading: {{{_shading_text(shading)}}}")
    if suggestion.clip:
        has_planes = any(clip.plane is not None for clip in suggestion.clip)
        yield from ("", *([_CLIP_COMMENT] if has_planes else []), "clip:")
        for clip in suggestion.clip:
            if clip.plane is not None:
                yield f"  - plane: {{point: {_list(clip.plane.point)}, normal: {_list(clip.plane.normal)}}}"
            elif clip.box is not None:
                yield f"  - box: [{_list(clip.box[0])}, {_list(clip.box[1])}]  # a corner, to look inside"


def _shading_text(shading: ShadingSpec) -> str:
    """Return the section `shading` as text: the keys of _ALWAYS_SHOWN, and keys whose values are not the defaults."""
    defaults, given = spec_to_dict(ShadingSpec()), spec_to_dict(shading)
    shown = {key: value for key, value in given.items() if key in _ALWAYS_SHOWN or value != defaults.get(key)}
    return ", ".join(f"{key}: {format_value(value)}" for key, value in shown.items())


def _with_comment(line: str, comment: str, *, indent: int = 0) -> str:
    return f"{line:<{_COMMENT_COLUMN - indent - 2}}  # {comment}" if comment else line


def _list(numbers: Sequence[float]) -> str:
    return f"[{', '.join(map(format_value, numbers))}]"


def _hex_color(color: Color) -> str:
    return "#" + "".join(f"{round(255 * part):02x}" for part in color)


def yaml_string(text: str | Path) -> str:
    """Return a string as YAML, in double quotes where needed, so that YAML reads the same string.

    Control characters, and bytes of a file name that are not UTF-8 (surrogates in Python), become escapes.
    """
    plain = str(text)
    if re.fullmatch(r"[\w./][\w./-]*", plain, re.ASCII) and parse_yaml(plain).data == plain:
        return plain
    quoted = plain.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{printable(quoted)}"'
