"""Compute and compare fingerprints: digests of everything that the frames of a film depend on."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from renderer.film import data_digest, file_digest
from renderer.record.film_record import FilmFingerprint
from renderer.scene import (
    ErrorSpec,
    FilmScene,
    OutputSpec,
    first_few,
    first_output,
    format_value,
    join_keys,
    outputs_of,
    scene_to_dict,
    schedule_to_dict,
    spec_to_dict,
    with_draw_order,
    with_files,
    without_sources,
)
from renderer.system import package_versions, sources_digest

# These keys say what is in the frames; others say how they become a film, and what is told of it.
_DRAWN_KEYS = ("size", "background")
_NOT_ENCODED = ("file",)


def film_fingerprint(scene: FilmScene, requested: ErrorSpec, volume_fingerprint: str, device: str) -> FilmFingerprint:
    """Return the fingerprint of a film: scene, voxels, versions and device.

    The schedule counts as it was requested, not as the tolerances that were found for it, so a film that is rendered
    from its sidecar has the same fingerprint.
    """
    tree = without_sources(scene_to_dict(with_draw_order(scene)))
    tree = with_files(tree, lambda _, name: Path(name).name)  # fonts and logos may move
    left_out = {*schedule_to_dict(scene.error), "probes"}
    rest = {key: value for key, value in tree["error"].items() if key not in left_out}
    output = {key: first_output(tree)[key] for key in _DRAWN_KEYS}
    shown: dict[str, Any] = {}
    first = scene.at(0)
    if first.annotation.entries:
        shown |= {"units": [layer.volume.unit for layer in first.layers]}
        shown |= {"files of annotation": [file_digest(file) for file in first.annotation.files]}
    depends_on = {
        "scene": tree | {"output": output, "error": {**schedule_to_dict(requested), **rest}} | shown,
        "volume": {"fingerprint": volume_fingerprint},
        "versions": package_versions(),
        "sources": sources_digest(),
        "device": device,
    }
    return fingerprint_of(json.loads(json.dumps(depends_on)), scene.output)


def fingerprint_of(depends_on: Mapping[str, Any], output: OutputSpec) -> FilmFingerprint:
    """Return the fingerprint of a film whose frames depend on this plain data."""
    tree = outputs_of({"output": spec_to_dict(output)})
    first, *others = ({key: value for key, value in each.items() if key not in _NOT_ENCODED} for each in tree)
    first = {key: value for key, value in first.items() if key not in _DRAWN_KEYS}
    encoding = json.loads(json.dumps({"output": [first, *others] if others else first}))
    return FilmFingerprint(data_digest(depends_on), encoding, depends_on)


def describe_differences(before: Any, now: Any) -> str:
    """Return the first few keys in which two fingerprints' data differ: `scene.error.tolerance was 0.2`."""
    found = [f"{path} was {format_value(old)}" for path, old, _ in differences(before, now)]
    return first_few(found, between="; ")


def describe_mismatch(before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Return why recorded data, which may be any, has another fingerprint than `now`."""
    if not before:
        return "its scene is not recorded"
    return describe_differences(before, now) or "the record of its scene was changed"


def differences(before: Any, now: Any, path: str = "") -> Iterator[tuple[str, Any, Any]]:
    """Yield the dotted paths of the values that differ, and both values: None where there is none."""
    if isinstance(before, list) and isinstance(now, list) and any(isinstance(item, dict) for item in now):
        before, now = dict(enumerate(before)), dict(enumerate(now))
    if isinstance(before, dict) and isinstance(now, dict):
        for key in dict.fromkeys([*now, *before]):
            yield from differences(before.get(key), now.get(key), join_keys(path, key))
    elif before != now:
        yield path, before, now
