"""List the changes of a scene, its volume, the device and the versions since goldens were drawn."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from hsplat_cli.compare.golden.record import Golden, GoldenRecord, Origin
from hsplat_cli.compare.golden.value_text import changed_value
from hsplat_cli.compare.outcome import Change
from renderer.scene import may_be_json, parse_yaml_file, read_content


def changes_since(record: GoldenRecord, goldens: Sequence[Golden], now: Origin, file: Path) -> Iterator[Change]:
    """Yield the changes of scene, volume, device and versions since some goldens of a record were drawn, each once.

    A frame may have goldens of several origins: the changes from the origin that has most in common with this one
    count. file: of the scene.
    """
    lines, found = _lines(file), dict[Change, None]()
    for used in dict.fromkeys(frozenset(picture.origin for picture in golden.pictures) for golden in goldens):
        origins = [record.origins[number] for number in sorted(used)]
        nearest = min(origins, key=lambda origin: (len(origin.changes(now)), origin.device != now.device))
        found |= dict.fromkeys(_changes(nearest, now, lines))
    yield from found


def input_changes(before: Origin, now: Origin, lines: Mapping[str, int]) -> Iterator[Change]:
    """Yield the changes of scene and volume from an origin to another one. lines: of the keys in the scene's file."""
    for path, was, value in before.changes(now):
        key, old, new = changed_value(path.removeprefix("scene."), was, value)
        yield Change(key, old, new, _line_of(key, lines))


def _changes(before: Origin, now: Origin, lines: Mapping[str, int]) -> Iterator[Change]:
    """Yield the changes from an origin to another one. lines: as in `input_changes`."""
    yield from input_changes(before, now, lines)
    if before.device != now.device:
        yield Change("device", before.device, now.device)
    for name in sorted(before.versions.keys() & now.versions):
        if before.versions[name] != now.versions[name]:
            yield Change(f"version of {name}", before.versions[name], now.versions[name])


def _lines(file: Path) -> dict[str, int]:
    """Return the line of each key in the file of a scene, by its dotted path; nothing for a sidecar."""
    content = read_content(file)
    if may_be_json(content):
        return {}
    locations = parse_yaml_file(content, file).locations
    return {path: location.key.line for path, location in locations.items()}


def _line_of(key: str, lines: Mapping[str, int]) -> int:
    """Return the line of a key, or of the nearest section around it that the file has; 0 without one."""
    while key:
        if key in lines:
            return lines[key]
        key = key.rpartition(".")[0]
    return 0
