"""Write a scene, or a part of one, as plain data that make the same scene when they are read."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

from renderer.scene.camera_section import CameraPath, PathSequence
from renderer.scene.error_section import ErrorSpec, schedule_to_dict
from renderer.scene.labels_section import LabelsSpec, MaskSpec
from renderer.scene.layers_section import OF_CHANNELS, LayerSpec
from renderer.scene.message_text import join_keys
from renderer.scene.motion import Motion, OverFrames, motion_to_dict, values_at
from renderer.scene.output_section import OutputFile, OutputSpec
from renderer.scene.spec import FilmScene, Scene
from renderer.scene.splat_section import SplatSpec, unused_splat_keys
from renderer.scene.transfer_section import ColormapSpec, TransferSpec
from renderer.scene.volume_files import FileSource
from renderer.scene.volume_section import VOLUME_TABLE, ArraySource, VolumeSpec


def scene_to_dict(scene: FilmScene) -> dict[str, Any]:
    """Return the scene as plain data for JSON or YAML, with every default written out.

    `parse_scene` makes the same scene from it: with any `base` if the volume's file is an absolute path, else in the
        same folder.
    """
    sections: OverFrames[Scene] = scene.map(lambda each: each)
    return {"version": sections.at(0).version} | spec_to_dict(sections)


def moving_values(scene: FilmScene, frame: int) -> dict[str, Any]:
    """Return what moves in a scene as it is at a frame: plain data by dotted keys."""

    def differences(film: Any, now: Any, path: str) -> Iterator[tuple[str, Any]]:
        if isinstance(film, list) and isinstance(now, list) and len(film) == len(now):
            film, now = dict(enumerate(film)), dict(enumerate(now))
        if isinstance(film, dict) and isinstance(now, dict) and film.keys() == now.keys():
            for key in film:
                yield from differences(film[key], now[key], join_keys(path, key))
        elif film != now:
            yield path, now

    now = replace(scene.at(frame), error=values_at(scene.error, frame))
    return dict(differences(scene_to_dict(scene), scene_to_dict(now), ""))


def without_sources(tree: Mapping[str, Any]) -> dict[str, Any]:
    """Return a scene as plain data without what says where its voxels come from, and which part of them is used."""

    def own(entry: Mapping[str, Any]) -> dict[str, Any]:
        mask = _without(entry.get("mask", {}), VOLUME_TABLE)
        return _without(entry, VOLUME_TABLE) | ({"mask": mask} if mask else {})

    rest = _without(own(tree), ["volume"])
    if "volumes" in tree:
        rest["volumes"] = [own(entry) for entry in tree["volumes"]]
    return rest


def spec_to_dict(value: Any) -> dict[str, Any]:
    """Return a part of a scene, such as a CameraSpec or a TransferSpec, as plain data; as `scene_to_dict`.

    value: as it is at a frame, or over the frames of its film.
    """
    value = value._value if isinstance(value, OverFrames) else value
    pairs = ((field.name, getattr(value, field.name)) for field in fields(value))
    plain = {name: _plain(item) for name, item in pairs if item is not None}  # None stands for a key that is not given
    for cls, change in _CHANGES.items():
        if isinstance(value, cls):
            return change(value, plain)
    return plain


def _without(plain: Mapping[str, Any], keys: Collection[str]) -> dict[str, Any]:
    return {key: item for key, item in plain.items() if key not in keys}


_OF_ONE_VOLUME = ("volume", "transfer_function")


def _of_scene(scene: Scene, plain: dict[str, Any]) -> dict[str, Any]:
    left_out = [*_OF_ONE_VOLUME, "labels"] if scene.volumes else ["volumes"]
    if not scene.volumes and scene.volume.component != "all":
        left_out.append("blend")
    return _without(_with_look(scene, plain), left_out)


def _of_layer(layer: LayerSpec, plain: dict[str, Any]) -> dict[str, Any]:
    if layer.color is not None:
        del plain["transfer_function"]
    return _with_own_keys(plain.pop("volume"), _with_look(layer, plain))


def _with_look(value: Scene | LayerSpec, plain: dict[str, Any]) -> dict[str, Any]:
    """Return plain data with the key that says how a volume looks."""
    if value.transfer_function == OF_CHANNELS:
        return _without(plain, ["transfer_function"])
    if value.transfer_function.labels is not None:
        return {"labels" if key == "transfer_function" else key: item for key, item in plain.items()}
    return plain


def _of_mask(mask: MaskSpec, plain: dict[str, Any]) -> dict[str, Any]:
    labels, volume = _without(plain.pop("labels"), ["colors"]), plain.pop("volume")
    return _with_own_keys({"name": volume} if isinstance(volume, str) else volume, labels | plain)


def _with_own_keys(volume: dict[str, Any], own: dict[str, Any]) -> dict[str, Any]:
    return {**volume, **{key: item for key, item in own.items() if item not in ("", [])}}


def _of_labels(labels: LabelsSpec, plain: dict[str, Any]) -> dict[str, Any]:
    for key in ("colors", "opacity", "names"):
        if isinstance(pairs := getattr(labels, key), tuple):
            plain[key] = {label: _plain(item) for label, item in pairs}
    return {key: item for key, item in plain.items() if item != []}


def _of_volume(volume: VolumeSpec, plain: dict[str, Any]) -> dict[str, Any]:
    source: dict[str, Any] = plain.pop("source")
    if not volume.interpolate:  # which not all sources have
        del plain["interpolate"]
    return (source if isinstance(volume.source, FileSource) else {volume.source.key: source}) | plain


def _of_file(plain: dict[str, Any]) -> dict[str, Any]:
    spacing = {"spacing": plain["spacing"]} if "spacing" in plain else {}
    return {"file": plain.get("collection") or plain["steps"] or plain["file"]} | spacing


def _of_transfer(transfer: TransferSpec, plain: dict[str, Any]) -> dict[str, Any]:
    mapping = plain.pop("mapping")
    plain.pop("imported", None)
    if not transfer.relative:
        del plain["relative"]
    if isinstance(transfer.mapping, ColormapSpec):
        mapping = {"colormap": mapping.pop("name")} | mapping
    has_keys = isinstance(transfer.mapping, (ColormapSpec, LabelsSpec))
    return (mapping if has_keys else {"points": mapping}) | plain


def _of_outputs(output: OutputSpec, plain: dict[str, Any]) -> Any:
    others: list[dict[str, Any]] = plain.pop("others")
    first = _of_output(output, plain)
    return [first, *others] if others else first


def _of_output(output: OutputFile, plain: dict[str, Any]) -> dict[str, Any]:
    if output.every == 1:
        del plain["every"]
    return plain | {"background": _of_background(plain.get("background", "transparent"))}


def _of_background(plain: Any) -> Any:
    """Return a background with the keys of the ends of a gradient, which may move."""
    if isinstance(plain, dict):
        return {key: _of_background(item) for key, item in plain.items()}
    is_gradient = isinstance(plain, list) and not isinstance(plain[0], (int, float))
    return dict(zip(("top", "bottom"), plain, strict=True)) if is_gradient else plain


# What differs, for each part of a scene, between its fields and its keys.
_CHANGES: dict[Any, Callable[[Any, dict[str, Any]], dict[str, Any]]] = {
    Scene: _of_scene,
    LayerSpec: _of_layer,
    MaskSpec: _of_mask,
    LabelsSpec: _of_labels,
    VolumeSpec: _of_volume,
    FileSource: lambda _, plain: _of_file(plain),
    TransferSpec: _of_transfer,
    ErrorSpec: lambda error, plain: schedule_to_dict(error) | _without(plain, ("tolerance", "goal")),
    SplatSpec: lambda splat, plain: _without(plain, unused_splat_keys(splat.footprint)),
    OutputSpec: _of_outputs,
    OutputFile: _of_output,
    CameraPath: lambda path, plain: {"type": path.type} | plain,
}


def _plain(value: Any) -> Any:
    if isinstance(value, Motion):
        return motion_to_dict(value, _plain)
    if isinstance(value, PathSequence):
        return [_plain(piece) for piece in value.pieces]
    if isinstance(value, tuple):
        items = [_plain(item) for item in value]
        if None in items:  # a range for some of the axes
            return {axis: pair for axis, pair in zip("xyz", items, strict=True) if pair is not None}
        return items
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, ArraySource):
        return {"shape": list(value.shape), "dtype": str(value.values.dtype), "spacing": list(value.spacing)}
    return spec_to_dict(value) if is_dataclass(value) else value
