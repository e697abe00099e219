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

    Goldens may have several origins: the changes from the origin that has most in common with this one count. file: of
    the scene.
    """
    used = {picture.origin for golden in goldens for picture in golden.pictures}
    origins = [record.origins[number] for number in sorted(used)]
    nearest_origin = min(origins, key=lambda origin: (len(origin.changes(now)), origin.device != now.device))
    lines = _lines(file)
    for path, was, value in nearest_origin.changes(now):
        key, before, after = changed_value(path.removeprefix("scene."), was, value)
        yield Change(key, before, after, _line_of(key, lines))
    if nearest_origin.device != now.device:
        yield Change("device", nearest_origin.device, now.device)
    for name in sorted(nearest_origin.versions.keys() & now.versions):
        if nearest_origin.versions[name] != now.versions[name]:
            yield Change(f"version of {name}", nearest_origin.versions[name], now.versions[name])


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
