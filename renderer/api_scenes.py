"""Turn the arguments of the Python API into scenes and frame numbers. Errors name the parameters of the API."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from renderer.errors import InputError, SceneError
from renderer.readers import is_volume_name, read_volume
from renderer.resolve import resolve_scene
from renderer.scene import (
    MAX_DEPTH,
    ArraySource,
    CameraSpec,
    FilmScene,
    ProceduralSource,
    Scene,
    TransferSpec,
    format_value,
    load_scene,
    only_output,
    output_suffix,
    parse_scene,
    scene_to_dict,
    short_text,
    spec_to_dict,
)
from renderer.suggest import FilmOptions, Wish

# The types that the API takes for a scene: a scene, the name of a scene file, or a volume (an array or a file's name).
SceneLike: TypeAlias = "FilmScene | str | os.PathLike[str] | npt.ArrayLike"
# The types that the API takes for a transfer function: a colormap's name, control points, a mapping, or a TransferSpec.
TransferLike: TypeAlias = "str | Sequence[Any] | Mapping[str, Any] | TransferSpec"
# The types that the API takes for a camera: a mapping, or a CameraSpec.
CameraLike: TypeAlias = "Mapping[str, Any] | CameraSpec"

# The keys of a scene, each with the parameter of the API that sets it. Errors name the parameter.
_PARAMETERS = {
    "volume.procedural.spacing": "spacing",
    "volume.procedural.shape": "the array's shape",
    "volume.spacing": "spacing",
    "volume.file": "volume",
    "output.size": "size",
    "output.background": "background",
    "output.file": "output",
    "error.tolerance": "tolerance",
}


def make_scene(
    source: SceneLike, options: Mapping[str, Any], *, is_volume: bool = False, is_single_frame: bool = False
) -> FilmScene:
    """Return a checked scene with the given options. Options that are None are ignored.

    is_volume: whether a name is the name of a volume's file, and not of a scene file. is_single_frame: whether one
        frame is drawn, so that the output may be a picture.
    """
    if isinstance(source, (str, os.PathLike)) and not (is_volume or is_volume_name(source)):
        source = load_scene(scene_file(source), is_single_frame=True)
    given = {name: _plain(value) for name, value in options.items() if value is not None}
    is_new, array = not isinstance(source, FilmScene), None
    if isinstance(source, FilmScene):
        tree, array = scene_to_dict(source), source.at(0).layers[0].volume.source
    elif isinstance(source, (str, os.PathLike)):
        tree = _turntable() | {"volume": {"file": os.fspath(source)}}
    else:
        tree, array = _turntable() | {"volume": {}}, _array_source(source)
    if isinstance(array, ArraySource):  # a constant volume stands for the array while the scene is parsed
        section = {"name": "constant", "shape": list(array.shape), "spacing": given.pop("spacing", array.spacing)}
        tree["volume"] = {key: value for key, value in tree["volume"].items() if key != "array"}
        tree["volume"]["procedural"] = section
    wish = _wish(given.get("transfer_function"))
    scene = _parse(_with_options(tree, given), is_single_frame=is_single_frame)
    if isinstance(array, ArraySource):
        stand_in = scene.at(0).layers[0].volume.source
        assert isinstance(stand_in, ProceduralSource)
        placed = replace(array, spacing=stand_in.spacing)
        scene = scene.changed(lambda each: _with_source(each, placed))
    # Plain data do not say where a transfer function was imported from, so the transfer functions of the given scene
    # are taken over.
    if isinstance(source, FilmScene) and "transfer_function" not in given:
        scene = scene.changed(_with_transfer_functions, source)
    suggests = wish is not None or (is_new and "transfer_function" not in given)
    return resolve_scene(_with_suggestion(scene, wish) if suggests else scene, read_volume)


def _with_source(scene: Scene, source: ArraySource) -> Scene:
    """Return the scene with `source` in place of the source of its first volume."""
    first, *others = scene.layers
    first = replace(first, volume=replace(first.volume, source=source))
    return replace(scene, layers=(first, *others))


def _with_transfer_functions(scene: Scene, other: Scene) -> Scene:
    pairs = zip(scene.layers, other.layers, strict=True)
    layers = (replace(layer, transfer_function=same.transfer_function) for layer, same in pairs)
    return replace(scene, layers=tuple(layers))


def _wish(transfer_function: Any) -> Wish | None:
    """Return the colormap or preset that a suggestion shall have; None if `transfer_function` is not a name of one."""
    match transfer_function:
        case str(colormap):
            return Wish(colormap)
        case {"preset": str(preset), **others} if not others:
            return Wish(preset=preset)
    return None


def _turntable() -> dict[str, Any]:
    """Return the scene that `hsplat init` suggests, as a tree of plain data; its transfer function is a placeholder."""
    film = FilmOptions()
    path = {"type": "turntable", "frames": film.frames, "elevation": film.elevation, "axis": film.axis}
    return {
        "transfer_function": {"points": [{"value": 0, "color": "white", "opacity": 1}]},
        "camera": {"target": "visible", "path": path},
        "error": {"tolerance": film.tolerance},
        "output": {"file": "film.mp4"},
    }


def scene_file(name: Any) -> Path:
    """Return the path of a scene file from its name. Raises InputError for anything that is not a name."""
    if not isinstance(name, (str, os.PathLike)) or not isinstance(os.fspath(name), str) or not os.fspath(name):
        raise InputError("not the name of a scene file", got=argument_text(name), expected="a name such as scene.yaml")
    return Path(name)


def _array_source(values: npt.ArrayLike) -> ArraySource:
    if np.ma.is_masked(values):
        raise InputError(
            "a masked array, whose masked voxels would be drawn",
            expected="an array without a mask",
            hint="`array.astype(float).filled(numpy.nan)` hides the masked voxels, as NaN is hidden",
        )
    try:
        array = values if isinstance(values, np.memmap) else np.asarray(values)
    except (ValueError, TypeError, RuntimeError) as error:  # such as ragged lists, or tensors on another device
        got = short_text(" ".join(str(error).split()))
        raise InputError(
            "this cannot be converted to an array", got=got, expected="numbers in three axes, [z, y, x]"
        ) from error
    if array.ndim != 3:
        what = "the array does not have the axes of a volume"
        got = f"shape {format_value(list(array.shape))}" if array.ndim else argument_text(values)
        raise InputError(what, got=got, expected="three axes, [z, y, x]")
    return ArraySource(array.view(np.uint8) if array.dtype == np.bool_ else array)


def _plain(value: Any, num_levels: int = MAX_DEPTH) -> Any:
    """Return an option as the plain data of a scene: numbers, texts, lists and mappings.

    num_levels: the largest number of nested levels. Raises InputError if there are more.
    """
    if num_levels == 0:
        raise InputError(f"an option of more than {MAX_DEPTH} levels", hint="does it contain itself?")
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, CameraSpec):  # None removes the keys of the scene that the camera does not set
        return {"target": None, "distance": None} | spec_to_dict(value)
    if isinstance(value, TransferSpec):
        return {"labels": spec_to_dict(value)} if value.labels is not None else spec_to_dict(value)
    if isinstance(value, Mapping):
        return {key: _plain(item, num_levels - 1) for key, item in value.items()}
    return [_plain(item, num_levels - 1) for item in value] if isinstance(value, (list, tuple)) else value


def _with_options(tree: dict[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return a scene's tree of plain data, in which options of `suggest_scene` replace values.

    given: the options by name, without options that are None.
    """
    if "spacing" in given:
        tree["volume"]["spacing"] = given["spacing"]
    if "camera" in given:
        camera = given["camera"]
        if isinstance(camera, dict):
            camera = {key: value for key, value in (tree["camera"] | camera).items() if value is not None}
        tree["camera"] = camera
    if "tolerance" in given:
        rest = {key: value for key, value in tree["error"].items() if key in ("measure", "of", "finest_level")}
        tree["error"] = rest | {"tolerance": given["tolerance"]}
    names = {"output": "file", "size": "size", "background": "background"}
    if "output" in given:
        tree["output"] = only_output(tree["output"], output_suffix(str(given["output"])))
    first = tree["output"][0] if isinstance(tree["output"], list) else tree["output"]
    first |= {key: given[name] for name, key in names.items() if name in given}
    if "transfer_function" in given:
        tree.pop("labels", None)
    match given.get("transfer_function"):
        case {"labels": labels, **others} if not others:
            tree.pop("transfer_function", None)
            tree["labels"] = labels
        case str(colormap):  # range and opacities are placeholders, which a suggestion replaces
            tree["transfer_function"] = {"colormap": colormap, "range": [0, 1], "opacity": [[0, 1]]}
        case [*points]:
            tree["transfer_function"] = {"points": [_control_point(point) for point in points]}
        case section if section is not None and _wish(section) is None:
            tree["transfer_function"] = section
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
        raise SceneError([replace(each, path=_parameter(each.path)) for each in error.problems]) from None


def _parameter(path: str) -> str:
    """Return the parameter of the API that sets a key of the scene; the key itself if there is no such parameter."""
    key = next((key for key in _PARAMETERS if path == key or path.startswith(f"{key}.")), None)
    return path if key is None else _PARAMETERS[key] + path.removeprefix(key)


def _with_suggestion(scene: FilmScene, wish: Wish | None) -> FilmScene:
    """Return the scene with the transfer function, light and clip planes that are suggested for its first volume."""
    from renderer.suggest import suggest_for

    found = suggest_for(scene.at(0).layers[0].volume, read_volume, wish=wish or Wish())
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
