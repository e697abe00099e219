"""Write a scene, or a part of one, as plain data that make the same scene when they are read."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import is_dataclass, replace
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from renderer.scene.message_text import join_keys
from renderer.scene.motion import Motion, OverFrames, motion_to_dict, values_at
from renderer.scene.spec import FilmScene
from renderer.scene.volume_section import VOLUME_TABLE


@runtime_checkable
class _Written(Protocol):
    """A part of a scene that is written with other keys than the names of its fields."""

    def written(self) -> object:
        """Return this part as a scene file has it: keys with their values, or a single value.

        Values may be parts of a scene, or motions.
        """


def scene_to_dict(scene: FilmScene) -> dict[str, Any]:
    """Return the scene as plain data for JSON or YAML, with every default written out.

    `parse_scene` makes the same scene from it: with any `base` if the volume's file is an absolute path, else in the
        same folder.
    """
    return spec_to_dict(scene.map(lambda sections: sections))


def moving_values(scene: FilmScene, frame: int) -> dict[str, object]:
    """Return the values that move in a scene, as they are at a frame: plain data by their dotted keys."""

    def differences(film: object, now: object, path: str) -> Iterator[tuple[str, object]]:
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
    """Return the plain data of a scene without the keys of volumes that name voxels or choose some of them.

    tree: the plain data of the scene, which stays unchanged.
    """

    def own(entry: Mapping[str, Any]) -> dict[str, Any]:
        mask = _without(entry.get("mask", {}), VOLUME_TABLE)
        return _without(entry, VOLUME_TABLE) | ({"mask": mask} if mask else {})

    rest = _without(own(tree), ["volume"])
    if "volumes" in tree:
        rest["volumes"] = [own(entry) for entry in tree["volumes"]]
    return rest


def spec_to_dict(value: object) -> dict[str, Any]:
    """Return a part of a scene, such as a CameraSpec or a TransferSpec, as plain data for JSON or YAML.

    value: the part at a frame, or over all frames of the film.
    """
    plain: dict[str, Any] = _plain(value._value if isinstance(value, OverFrames) else value)
    return plain


def _without(plain: Mapping[str, Any], keys: Collection[str]) -> dict[str, Any]:
    return {key: item for key, item in plain.items() if key not in keys}


def _plain(value: object) -> Any:
    """Return a part of a scene as plain data. Keys with the value None are left out."""
    if isinstance(value, Motion):
        return motion_to_dict(value, _plain)
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, (tuple, list)):
        return [_plain(item) for item in value]
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, _Written):
        return _plain(value.written())
    return _plain(vars(value)) if is_dataclass(value) else value
