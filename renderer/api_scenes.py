"""Turn the arguments of the Python API into scenes and frame numbers. Errors name the parameters of the API."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from renderer.api_layers import (
    Grid,
    Layer,
    VolumesLike,
    labels_section,
    layers_of,
    mask_section,
    plain,
    volume_section,
)
from renderer.errors import InputError, Problem, SceneError
from renderer.readers import is_volume_name, read_volume
from renderer.resolve import resolve_scene
from renderer.scene import (
    ENVIRONMENTS,
    ArraySource,
    CameraSpec,
    FilmScene,
    Scene,
    VolumeSpec,
    did_you_mean,
    load_scene,
    only_output,
    output_suffix,
    parse_scene,
    scene_to_dict,
    short_text,
)
from renderer.suggest import NO_WISH, FilmOptions, Wish, suggest_several

SceneLike: TypeAlias = "FilmScene | VolumesLike"
"""A `FilmScene`; the name of a scene file; or one or several volumes (`VolumesLike`), for which a scene is
suggested."""
CameraLike: TypeAlias = "Mapping[str, Any] | CameraSpec"
"""A camera: a mapping as in a scene file, or a CameraSpec, such as `scene.at(0).camera`."""
LightLike: TypeAlias = "Mapping[str, Any] | str"
"""A light that matter scatters: a mapping as in a scene file, or the name of an environment."""

# The keys of a scene, each with the parameter of the API that sets it. Errors name the parameter.
_PARAMETERS = {
    "volume.spacing": "spacing",
    "volume.file": "volume",
    "mask.file": "mask",
    "output.size": "size",
    "output.background": "background",
    "output.file": "output",
    "error.tolerance": "tolerance",
}
# The parameters of the API that change a scene or its suggestion.
_OPTIONS = frozenset(
    ("labels", "mask", "spacing", "transfer_function", "light", "camera", "size", "background", "tolerance", "output")
)
# The look of a volume that a suggestion replaces.
_PLACEHOLDER = {"points": [{"value": 0, "color": "white", "opacity": 1}]}


def options_of(parameters: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options of a scene among the parameters of a function, which are its `locals()` at its beginning."""
    return {name: value for name, value in parameters.items() if name in _OPTIONS}


def make_scene(
    source: SceneLike, options: Mapping[str, Any], *, is_volume: bool = False, is_single_frame: bool = False
) -> FilmScene:
    """Return a checked scene with the given options. Options that are None are ignored.

    is_volume: whether a name is the name of a volume's file, and not of a scene file. is_single_frame: whether one
        frame is drawn, so that the output may be a picture.
    """
    if isinstance(source, (str, os.PathLike)) and not (is_volume or is_volume_name(source)):
        source = load_scene(scene_file(source), is_single_frame=True)
    labels, mask = options.get("labels"), options.get("mask")
    others = {name: value for name, value in options.items() if value is not None and name not in ("labels", "mask")}
    if isinstance(source, FilmScene):
        given = {name: plain(value) for name, value in others.items()}
        return _changed_scene(source, given, labels, mask, is_single_frame=is_single_frame)
    layers = _with_labels(layers_of(source), labels)
    transfer = others.pop("transfer_function", None)
    if transfer is not None:
        _require_one(layers, labels)
        layers[0] = replace(layers[0], transfer_function=transfer)
    environment = others.pop("light", None) if isinstance(others.get("light"), str) else None
    if environment is not None:
        _require_light(layers, environment)
    given = {name: plain(value) for name, value in others.items()}
    tree = _subject(layers, given.pop("spacing", None), mask) | _turntable()
    scene = _parse(_with_options(tree, given), is_single_frame=is_single_frame)
    return resolve_scene(_with_looks(scene, layers, environment), read_volume)


def _with_labels(layers: list[Layer], labels: Any) -> list[Layer]:
    """Return the layers with the option `labels`: a volume of labels over them, or the names of their own labels."""
    if isinstance(labels, Mapping):
        if len(layers) > 1:
            hint = "`renderer.Layer(values, labels=...)` says so"
            got = argument_text(labels)
            raise InputError("names of labels, but not of which volume", where="labels", got=got, hint=hint)
        return [replace(layers[0], labels=labels, transfer_function=None)]
    if labels is None:
        return layers
    if isinstance(labels, (list, tuple)) and labels and all(isinstance(each, str) for each in labels):
        expected = "a volume of labels, or a mapping from numbers to names"
        hint = '`labels={1: "liver"}` names the label 1'
        got = argument_text(labels)
        raise InputError("names without numbers", where="labels", got=got, expected=expected, hint=hint)
    (layer,) = layers_of([labels]) if isinstance(labels, Layer) else [Layer(labels)]
    return [*layers, replace(layer, name=layer.name or "labels", labels=layer.labels or {})]


def _require_one(layers: Sequence[Layer], labels: Any) -> None:
    """Raise InputError for the option `transfer_function` with several volumes, or with names of labels."""
    if len(layers) > 1 + (labels is not None):
        hint = "`renderer.Layer(values, transfer_function=...)` gives each its own"
        raise InputError("of several volumes each has its own", where="transfer_function", hint=hint)
    if isinstance(labels, Mapping):
        raise InputError("contradicts labels", where="transfer_function", expected="one of them")


def _require_light(layers: Sequence[Layer], environment: str) -> None:
    """Raise InputError for the name of an environment that is unknown, or for volumes whose light is not suggested."""
    if environment not in ENVIRONMENTS:
        hint = did_you_mean(environment, ENVIRONMENTS)
        expected = f"{', '.join(ENVIRONMENTS)}, or a mapping as in a scene file"
        raise InputError("unknown environment", where="light", got=environment, expected=expected, hint=hint)
    if len(layers) > 1:
        raise _no_light_of_several()
    if layers[0].wish is None:
        hint = f'`light={{"environment": "{environment}"}}`'
        raise InputError("this light is suggested with a look, but the volume has its own", where="light", hint=hint)


def _no_light_of_several() -> InputError:
    """Return the error for suggested looks of several volumes, which are seen by shading, or whose light adds up."""
    what = "several volumes have no suggested looks in a light that matter scatters"
    return InputError(what, where="light", hint="`renderer.Layer(values, transfer_function=...)` gives each its own")


def _subject(layers: Sequence[Layer], spacing: Any, mask: Any) -> dict[str, Any]:
    """Return the volumes, their looks and their masks as keys of a scene's tree. Looks are placeholders if open."""
    entries: list[dict[str, Any]] = []
    grid = None
    for number, layer in enumerate(layers, 1):
        called = f"the array {layer.name or number}" if len(layers) > 1 else ArraySource.name
        section = volume_section(layer, called, spacing, grid)
        if grid is None:
            grid = partial(Grid.of_section, section)
        look = look_keys(plain(layer.transfer_function))
        if layer.labels is not None:
            look = {"labels": labels_section(layer.labels)}
        own = {} if layer.mask is None else {"mask": mask_section(layer.mask, partial(Grid.of_section, section))}
        named = {"name": layer.name} if layer.name and len(layers) > 1 else {}
        entries.append({"volume": section, **named, **look, **own})
    assert grid is not None, "there is a layer"
    shared = {} if mask is None else {"mask": mask_section(mask, grid)}
    if len(entries) == 1:
        return {**entries[0], **shared}
    return {"volumes": [entry.pop("volume") | entry for entry in entries], **shared}


def look_keys(given: Any) -> dict[str, Any]:
    """Return the look of a volume as keys of a scene's tree. given: the plain data of a transfer function, or None."""
    match given:
        case {"labels": labels, **others} if not others:
            return {"labels": labels}
        case str(colormap):  # range and opacities are placeholders, which a suggestion replaces
            return {"transfer_function": {"colormap": colormap, "range": [0, 1], "opacity": [[0, 1]]}}
        case [*points]:
            return {"transfer_function": {"points": [_control_point(point) for point in points]}}
    is_open = given is None or Layer(0, transfer_function=given).wish is not None
    return {"transfer_function": _PLACEHOLDER if is_open else given}


def _with_looks(scene: FilmScene, layers: Sequence[Layer], environment: str | None) -> FilmScene:
    """Return the scene with suggested looks for the volumes whose looks are open.

    layers: of the scene, as given. environment: the name of the light that replaces the shading of one volume; or None.
    """
    wishes = [layer.wish if layer.labels is None else None for layer in layers]
    if any(layer.labels is not None for layer in layers):
        scene = resolve_scene(scene, read_volume)  # refuses volumes that are no labels
    elif not any(wish is not None for wish in wishes):
        return scene
    if len(layers) == 1:
        return _lit_labels(scene, environment) if wishes[0] is None else _with_suggestion(scene, wishes[0], environment)
    if scene.at(0).light is not None:
        raise _no_light_of_several()
    shown = tuple(suggest_several(scene.at(0).layers, wishes, read_volume))
    blend = "add" if all(wish == NO_WISH for wish in wishes) else "mix"
    return scene.changed(lambda each: replace(each, layers=shown, blend=blend))


def _lit_labels(scene: FilmScene, environment: str | None) -> FilmScene:
    """Return a scene of labels with the shading or the light that is suggested for them."""
    found = _with_suggestion(scene, Wish(preset="labels"), environment).at(0)
    return scene.changed(lambda each: replace(each.with_layers(shading=found.layers[0].shading), light=found.light))


def _changed_scene(
    source: FilmScene, given: dict[str, Any], labels: Any, mask: Any, *, is_single_frame: bool
) -> FilmScene:
    """Return a scene with changes. given: options by their names, as plain data."""
    tree = _tree_of(source)
    if labels is not None:
        if not isinstance(labels, Mapping):
            hint = "`renderer.suggest_scene(volume, labels=...)` makes a scene with them"
            expected = "a mapping from numbers to names"
            raise InputError("a scene takes no further volume", where="labels", expected=expected, hint=hint)
        given["transfer_function"] = {"labels": labels_section(labels)}
    if mask is not None:
        tree["mask"] = mask_section(mask, partial(Grid.of_volume, source.at(0).layers[0].volume))
    transfer = given.get("transfer_function")
    wish = None if transfer is None else Layer(0, transfer_function=transfer).wish
    scene = _parse(_with_options(tree, given), is_single_frame=is_single_frame)
    # Plain data do not say where a transfer function was imported from, so the transfer functions of the given scene
    # are taken over.
    if transfer is None:
        scene = scene.changed(_with_transfer_functions, source)
    return resolve_scene(scene if wish is None else _with_suggestion(scene, wish), read_volume)


def _tree_of(scene: FilmScene) -> dict[str, Any]:
    """Return a scene as a tree from which it can be parsed again: in the place of an array's keys it has the array."""
    tree = scene_to_dict(scene)
    for layer, entry in zip(scene.at(0).layers, tree.get("volumes", [tree]), strict=True):
        sections: list[tuple[Any, VolumeSpec | str]] = [(entry.get("volume", entry), layer.volume)]
        if layer.mask is not None:
            sections.append((entry.get("mask", tree.get("mask")), layer.mask.volume))
        for section, volume in sections:
            if isinstance(volume, VolumeSpec) and isinstance(volume.source, ArraySource):
                section.pop("array", None)
                section["file"] = volume.source
    return tree


def _with_transfer_functions(scene: Scene, other: Scene) -> Scene:
    pairs = zip(scene.layers, other.layers, strict=True)
    layers = (replace(layer, transfer_function=same.transfer_function) for layer, same in pairs)
    return replace(scene, layers=tuple(layers))


def _turntable() -> dict[str, Any]:
    """Return the scene that `hsplat init` suggests, without a volume, as a tree of plain data."""
    film = FilmOptions()
    path = {"type": "turntable", "frames": film.frames, "elevation": film.elevation, "axis": film.axis}
    return {
        "camera": {"target": "visible", "path": path},
        "error": {"tolerance": film.tolerance},
        "output": {"file": "film.mp4"},
    }


def scene_file(name: Any) -> Path:
    """Return the path of a scene file from its name. Raises InputError for anything that is not a name."""
    if not isinstance(name, (str, os.PathLike)) or not isinstance(os.fspath(name), str) or not os.fspath(name):
        raise InputError("not the name of a scene file", got=argument_text(name), expected="a name such as scene.yaml")
    return Path(name)


def _with_options(tree: dict[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return a scene's tree of plain data, in which options of `suggest_scene` replace values.

    given: the options by name, without options that are None.
    """
    if "spacing" in given:
        for section in tree.get("volumes", [tree.get("volume")]):
            section["spacing"] = given["spacing"]
    if "camera" in given:
        camera = given["camera"]
        if isinstance(camera, dict):
            camera = {key: value for key, value in (tree["camera"] | camera).items() if value is not None}
        tree["camera"] = camera
    if "light" in given:
        tree["light"] = given["light"]
        for section in (tree, *tree.get("volumes", [])):
            section.pop("shading", None)
    if "tolerance" in given:
        rest = {key: value for key, value in tree["error"].items() if key in ("measure", "of", "finest_level")}
        tree["error"] = rest | {"tolerance": given["tolerance"]}
    names = {"output": "file", "size": "size", "background": "background"}
    if "output" in given:
        tree["output"] = only_output(tree["output"], output_suffix(str(given["output"])))
    outputs = tree["output"] if isinstance(tree["output"], list) else [tree["output"]]
    first = dict(outputs[0])
    for each in outputs:  # further outputs that have the value of the first one get its new value
        changed = [name for name in names if name in given and each.get(names[name]) == first.get(names[name])]
        each |= {names[name]: given[name] for name in changed}
    if "transfer_function" in given:
        for key in ("labels", "transfer_function"):
            tree.pop(key, None)
        tree |= look_keys(given["transfer_function"])
    return tree


def _control_point(point: Any) -> Any:
    """Return a control point `(value, color, opacity)` as a mapping with these keys; anything else is unchanged."""
    keys = ("value", "color", "opacity")
    is_triple = isinstance(point, list) and len(point) == len(keys)
    return dict(zip(keys, point, strict=True)) if is_triple else point


def _parse(tree: dict[str, Any], *, is_single_frame: bool) -> FilmScene:
    try:
        return parse_scene(tree, base=Path.cwd(), is_single_frame=is_single_frame)
    except SceneError as error:
        raise SceneError([*dict.fromkeys(map(_in_words_of_the_api, error.problems))]) from None


def _in_words_of_the_api(problem: Problem) -> Problem:
    """Return a mistake in a scene with the parameter of the API that sets the key, and the API's control points."""
    place, _, last = problem.path.rpartition(".")
    hint = problem.hint
    if place.endswith("transfer_function.points") and last.isdecimal():
        hint = hint or "`(value, color, opacity)` is a control point, too"
    return replace(problem, path=_parameter(problem.path), hint=hint)


def _parameter(path: str) -> str:
    """Return the parameter of the API that sets a key of the scene; the key itself if there is no such parameter."""
    first, _, rest = path.partition(".")
    if first == "volumes" and rest.partition(".")[2].startswith("spacing"):
        return rest.partition(".")[2]
    key = next((key for key in _PARAMETERS if path == key or path.startswith(f"{key}.")), None)
    return path if key is None else _PARAMETERS[key] + path.removeprefix(key)


def _with_suggestion(scene: FilmScene, wish: Wish, environment: str | None = None) -> FilmScene:
    """Return the scene with the transfer function, light and clip planes that are suggested for its first volume.

    environment: the name of the light that replaces the suggested shading; None to keep it.
    """
    from renderer.suggest import suggest_for, with_light

    found = suggest_for(scene.at(0).layers[0].volume, read_volume, wish=wish)
    if (environment or scene.at(0).light) and found.layers:
        raise InputError("the light of channels adds up, and no matter scatters it", where="light")
    if environment is not None:
        found = replace(found, suggestion=with_light(found.suggestion, environment))
    return scene.changed(found.applied_to)


def frame_number(frame: int, scene: FilmScene) -> int:
    """Return the number of a frame, from 0 on; negative numbers count from the end of the path.

    Raises InputError for a frame that is not on the path.
    """
    if not isinstance(frame, (int, np.integer)):
        raise InputError(
            "not the number of a frame", where="frame", got=argument_text(frame), expected="a whole number"
        )
    return frame_numbers(frame, scene)[0]


def frame_numbers(frames: int | slice | Sequence[int] | None, scene: FilmScene) -> Sequence[int]:
    """Return the numbers of some frames, from 0 on; negative numbers count from the end of the path.

    frames: a number, a slice, ascending numbers, or None for all frames. Raises InputError for other values, and for
    frames that are not on the path.
    """
    path = range(scene.num_frames)
    with contextlib.suppress(IndexError, TypeError, ValueError):  # a slice with the step 0 raises ValueError
        if frames is None or isinstance(frames, slice):
            picked: Sequence[int] = path[frames or slice(None)]
        else:
            picked = [path[frames]] if isinstance(frames, (int, np.integer)) else [path[frame] for frame in frames]
        if picked and list(picked) == sorted(set(picked)):
            return picked
    expected = f"whole numbers from 0 to {path[-1]}, ascending, or from -1 for the last one"
    raise InputError("no such frames", where="frames", got=argument_text(frames), expected=expected)


def argument_text(value: object) -> str:
    """Return an argument as text for a message: its `repr`, cut to a readable length."""
    return short_text(repr(value))
