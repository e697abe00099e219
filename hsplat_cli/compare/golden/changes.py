"""List the changes of a scene, its volume, the device and the versions since goldens were drawn."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from hsplat_cli.compare.golden.record import Golden, GoldenRecord, Origin
from hsplat_cli.compare.outcome import Change
from renderer.scene import format_value, join_keys, may_be_json, parse_yaml_file, read_content

# The keys of scenes whose values are colours, or hold colours.
_COLOR_KEYS = frozenset(("color", "colors", "background"))
# The largest distance of a channel from a whole number of 1/255, in steps of 1/255, at which a colour is hexadecimal.
_ROUNDING = 1e-6


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
        key = path.removeprefix("scene.")
        yield Change(key, _text(key, was), _text(key, value), _line_of(key, lines))
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


def _text(key: str, value: object) -> str:
    """Return the value of a key as text; empty for a missing value."""
    return "" if value is None else format_value(_with_hex_colors(key, value))


def _with_hex_colors(key: str, value: Any) -> Any:
    """Return the value of a key with each colour in it as `#6680e6`, as far as a channel of 8 bits can have it."""
    if isinstance(value, Mapping):
        return {name: _with_hex_colors(join_keys(key, str(name)), each) for name, each in value.items()}
    if not isinstance(value, list):
        return value
    if not _COLOR_KEYS.isdisjoint(key.split(".")) and _is_of_8_bits(value):
        return "#" + "".join(f"{round(255 * channel):02x}" for channel in value)
    return [_with_hex_colors(join_keys(key, str(number)), each) for number, each in enumerate(value)]


def _is_of_8_bits(color: Sequence[Any]) -> bool:
    """Return whether a list is a colour whose channels, from 0 to 1, are whole numbers of 1/255."""
    are_channels = len(color) == 3 and all(type(each) in (int, float) and 0 <= each <= 1 for each in color)
    return are_channels and all(abs(255 * each - round(255 * each)) <= _ROUNDING for each in color)
