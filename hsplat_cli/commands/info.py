"""Run `hsplat info VOLUME`: describe a volume and suggest a transfer function."""

from __future__ import annotations

import json
import math
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from itertools import islice
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hsplat_cli.commands.shared_options import cache_option
from hsplat_cli.scenes import (
    ReadingOptions,
    expand_volumes,
    read_with_options,
    transfer_lines,
    volume_options,
    volume_spec,
)
from hsplat_cli.terminal import Reporter, VolumePath, format_table
from renderer.errors import InputError
from renderer.scene import FileSource, VolumeSpec, counted, load_scene, parse_yaml
from renderer.system import join_lines, printable

if TYPE_CHECKING:
    from renderer.statistics import Statistics
    from renderer.suggest import ShownLayer, Suggestion
    from renderer.volume import Channel, Float64, Volume, VolumeLevel

# Width of the histogram, in characters.
_COLUMNS = 64
# Height of the histogram, in lines.
_ROWS = 8
# A material is marked as hidden if its share of the picture is below this number, and its share of the voxels above it.
_HIDDEN = 0.01
# Largest number of labels that the text lists; JSON has all of them.
_MAX_LABELS = 40
# The largest number of files of a folder whose sizes are added. 10,000 take about 0.1 s.
_MOST_FILES = 10_000
_ALL_COMPONENTS = "`hsplat init VOLUME --component all` draws all together"
# Characters for the heights of a histogram's bars, from empty to full.
_BLOCKS = " ▁▂▃▄▅▆▇█"
# Characters for the heights of bars on a terminal whose encoding lacks block characters.
_ASCII = " .:|#"


@dataclass(frozen=True)
class _TimeFacts:
    """The facts about the steps in time of a volume.

    steps: the number of steps. first_last: the first and the last time. unit: the unit of times. files: the first and
    the last file, if each step has a file.
    """

    steps: int
    first_last: list[float]
    unit: str
    files: list[str]


@dataclass(frozen=True)
class _LabelFacts:
    """The facts about a label that is shown.

    voxels: its number of voxels. volume: its size, in cubic world units. share: the share of the picture that it
    covers.
    """

    value: float
    name: str
    voxels: int
    volume: float
    share: float


@dataclass(frozen=True)
class _VolumeFacts:
    """The facts about a volume that `hsplat info` prints, as text or as JSON."""

    name: str
    note: str | None
    channels: Sequence[Channel]
    shape: Sequence[int]
    dtype: str
    bytes: int
    stays_in_file: bool
    decoded_on_disk: bool
    without_data: int
    spacing: list[float]
    replaced_spacing: list[float] | None
    length_unit: str
    world_axes: str
    value_unit: str
    world_size: list[float]
    world_box: list[list[float]]
    origin: list[float]
    direction: str
    direction_matrix: list[list[float]]
    minimum: float
    maximum: float
    mean: float
    percentiles: dict[str, float]
    sampled_voxels: int | None
    fingerprint: str
    histogram: dict[str, list[float]]
    far_values: list[dict[str, float]]
    visible: Sequence[ShownLayer]
    label_table: list[_LabelFacts]
    kind: str
    reason: str
    transfer: dict[str, object]
    time: _TimeFacts | None
    levels: Sequence[VolumeLevel]
    stored_bytes: int | None

    def to_json(self) -> dict[str, object]:
        """Return the facts as plain data; the sections of a scene that are suggested are further entries."""
        found = asdict(self)
        time, transfer = found.pop("time"), found.pop("transfer")
        levels = [each._asdict() for each in self.levels]
        return {**found, **transfer, "time": time, "levels": levels}


@click.command()
@click.argument("volume", type=VolumePath())
@volume_options()
@cache_option
@click.option("--json", "as_json", is_flag=True, help="Print the same as JSON.")
def info(*, volume: Path | str, as_json: bool, reading: ReadingOptions) -> None:
    """Describe a volume: shape, place, values and histogram.

    VOLUME is a file, a folder of slices, or a store, also at a URL. The last part of the output suggests a transfer
    function to paste into a scene file, and lists the materials that it shows. For a scene file or a folder of several
    volumes, info prints a table of the volumes.
    """
    from renderer.suggest import Wish, read_in_colors, suggest_read

    if reading.component == "all":
        hint = f"leave it out: all are listed; {_ALL_COMPONENTS}"
        raise InputError("this describes one component", where="--component all", hint=hint)
    reporter = Reporter()
    click.get_current_context().with_resource(reporter.passes())
    inside = expand_volumes([str(volume)])[0] if isinstance(volume, Path) and volume.is_dir() else []
    named = [(str(each), volume_spec(each, reading)) for each in inside]
    is_scene = isinstance(volume, Path) and volume.suffix.lower() in (".yaml", ".yml")
    if isinstance(volume, Path) and is_scene:
        layers = [(each.name or f"volumes.{k}", each.volumes) for k, each in enumerate(load_scene(volume).at(0).layers)]
        named = [(name + ".mask" * (key == "mask"), each) for name, of in layers for key, each in of.items()]
    if is_scene or len(named) > 1:
        rows = [_row(*each) for each in named]
        if any("steps" in row for row in rows):
            rows = [row | {"steps": row.get("steps", "-")} for row in rows]
        table = format_table([list(rows[0]), *(list(map(str, row.values())) for row in rows)])
        reporter.result(join_lines(json.dumps(rows, indent=2).splitlines()) if as_json else table)
        return
    spec = volume_spec(volume, reading)
    first = read_with_options(spec, reporter)
    spec, read, statistics = read_in_colors(spec, first, partial(read_with_options, reporter=Reporter(is_quiet=True)))
    suggestion = suggest_read(spec, read, statistics, Wish()).suggestion
    facts = _facts(read, statistics, suggestion, _time_facts(read, spec), _stored_bytes(spec) if read.levels else None)
    described = None if spec.has_colors else spec.component or 0
    fact_lines = _fact_lines(facts, _histogram_marks(), described)
    text_lines = [*fact_lines, *_suggestion_lines(suggestion, facts)]
    reporter.result(join_lines(json.dumps(facts.to_json(), indent=2).splitlines() if as_json else text_lines))


def _row(name: str, volume: VolumeSpec) -> dict[str, str]:
    """Return a volume's row of the table of volumes, with the reason in place of the shape if it cannot be read."""
    from renderer.readers import find_volume

    row = {"volume": name, "format": "-", "type": "-"}
    try:
        if isinstance(volume.source, FileSource):
            row["format"] = find_volume(volume.source.file)[1]
        read = read_with_options(volume, Reporter(is_quiet=True))
    except InputError as error:
        return row | {"shape": str(error).splitlines()[0]}
    level = next((number for number, each in enumerate(read.levels) if each.is_read), 0)
    shape = " x ".join(map(str, read.shape_xyz)) + f" (level {level})" * (level > 0)
    row |= {"type": read.values.dtype.name, "shape": shape}
    time = _time_facts(read, volume)
    return row | ({"steps": _time_text(time)} if time else {})


def _time_facts(volume: Volume, spec: VolumeSpec) -> _TimeFacts | None:
    """Return the facts about steps in time; None for a volume of one step."""
    if volume.num_times == 1:
        return None
    steps = getattr(spec.source, "steps", ())
    files = [str(steps[0]), str(steps[-1])] if steps else []
    return _TimeFacts(volume.num_times, list(volume.times[:: volume.num_times - 1]), volume.time_unit, files)


def _time_text(time: _TimeFacts) -> str:
    """Describe steps in time: `30 steps, 0 to 58 s, a_00.nrrd to a_29.nrrd`, without parts that are not known."""
    moments = f"{_numbers(time.first_last, ' to ')} {time.unit}".strip()
    files = " to ".join(printable(Path(file).name) for file in time.files)
    return ", ".join(filter(None, (counted(time.steps, "step"), moments, files)))


def _stored_bytes(spec: VolumeSpec) -> int | None:
    """Return the bytes of the files of a volume; None for a URL, for several files, and for a folder of many files."""
    if not isinstance(spec.source, FileSource) or spec.source.steps:
        return None
    if not spec.source.file.is_dir():
        return spec.source.file.stat().st_size
    every = (os.path.join(folder, name) for folder, _, names in os.walk(spec.source.file) for name in names)
    sizes = [os.lstat(file).st_size for file in islice(every, _MOST_FILES)]
    return sum(sizes) if len(sizes) < _MOST_FILES else None


def _facts(
    volume: Volume,
    statistics: Statistics,
    suggestion: Suggestion,
    time: _TimeFacts | None,
    stored_bytes: int | None,
) -> _VolumeFacts:
    """Return all facts about a volume."""
    from renderer.statistics import rebin

    counts, edges = rebin(statistics, _COLUMNS)
    axes = volume.world_from_index[:3, :3]
    spacing = volume.spacing
    return _VolumeFacts(
        name=volume.name,
        note=volume.note,
        channels=volume.channels,
        shape=list(volume.shape_xyz),
        dtype=volume.values.dtype.name,
        bytes=volume.values.nbytes,
        stays_in_file=volume.source is not None and not volume.is_on_disk,
        decoded_on_disk=volume.is_on_disk,
        without_data=volume.num_absent,
        spacing=spacing.tolist(),
        replaced_spacing=volume.file_spacing and list(volume.file_spacing),
        length_unit=volume.length_unit,
        world_axes=volume.world_axes,
        value_unit=volume.value_unit,
        world_size=(spacing * volume.shape_xyz).tolist(),
        world_box=[corner.tolist() for corner in volume.world_box],
        origin=volume.world_from_index[:3, 3].tolist(),
        direction=describe_direction(axes),
        direction_matrix=(axes / spacing).tolist(),
        minimum=statistics.minimum,
        maximum=statistics.maximum,
        mean=statistics.mean,
        percentiles={f"{percent:g}": value for percent, value in statistics.percentiles.items()},
        sampled_voxels=statistics.num_counted if statistics.is_of_sample else None,
        fingerprint=volume.fingerprint,
        histogram={"counts": counts.tolist(), "edges": edges.tolist()},
        far_values=[
            {"value": outlier.value, "last": outlier.last, "voxels": outlier.num}
            for outlier in statistics.outliers[: len(suggestion.outlier_notes)]
        ],
        visible=[] if suggestion.transfer.labels else suggestion.visible,
        label_table=_label_table(volume, suggestion) if suggestion.transfer.labels else [],
        kind=suggestion.kind,
        reason=suggestion.reason,
        transfer=parse_yaml("\n".join(transfer_lines(suggestion.transfer))).data,
        time=time,
        levels=volume.levels,
        stored_bytes=stored_bytes,
    )


def _label_table(volume: Volume, suggestion: Suggestion) -> list[_LabelFacts]:
    """Return the facts about each label that is shown."""
    rows = []
    for shown in suggestion.visible:
        voxels = round(shown.voxels * volume.values.size)
        rows.append(_LabelFacts(shown.ranges[0][0], shown.name, voxels, voxels * volume.voxel_volume, shown.share))
    return rows


def describe_direction(axes: Float64) -> str:
    """Describe how the index axes, the columns of a float64 [3, 3], lie in the world.

    The result begins with `axis-aligned`, followed by the axes that are swapped or flipped, with `oblique` for
    orthogonal axes that are rotated, or with `sheared`. Angles below a hundredth of a degree count as rounding errors.
    """
    import numpy as np

    unit = axes / np.linalg.norm(axes, axis=0)
    tolerance = np.radians(0.01)
    if np.abs(unit.T @ unit - np.eye(3)).max() > tolerance:
        return "sheared"
    along = np.abs(unit).argmax(axis=0)
    mirrored = ", mirrored" if np.linalg.det(unit) < 0 else ""
    if np.abs(unit).max(axis=0).min() < np.cos(tolerance):
        return "oblique" + mirrored
    words = ["axis-aligned"]
    if along.tolist() != [0, 1, 2]:
        words.append("x y z of the voxels lie along " + " ".join("xyz"[k] for k in along) + " of the world")
    flipped = [name for name, k, column in zip("xyz", along, unit.T, strict=True) if column[k] < 0]
    if flipped:
        words.append(f"{' '.join(flipped)} flipped")
    return ", ".join(words) + mirrored


def _number(value: float) -> str:
    """Return a number as text, with six digits, or with all digits of a whole number."""
    return str(int(value)) if value == int(value) and abs(value) < 1e15 else f"{value:.6g}"


def _memory_text(num_bytes: int) -> str:
    return f"{num_bytes / 2**20:.1f} MiB" if num_bytes >= 2**20 else counted(num_bytes, "byte")


def _numbers(values: Sequence[float], between: str = ", ") -> str:
    return between.join(_number(round(value, 9)) for value in values)


def _fact_lines(facts: _VolumeFacts, marks: str, component: int | str | None) -> list[str]:
    """Return the lines on a volume. component: the number of the component whose values they describe; None for all."""
    file_spacing = facts.replaced_spacing
    replaced = "" if file_spacing is None else f", in place of {_numbers(file_spacing, ' x ')}"
    length, value = (f" {unit}" * bool(unit) for unit in (facts.length_unit, facts.value_unit))
    low, high, mean = map(_number, (facts.minimum, facts.maximum, facts.mean))
    place = ", decoded into a file on disk" if facts.decoded_on_disk else " in memory"
    place = ", which stay in the file" if facts.stays_in_file else place
    is_one_of_several = len(facts.channels) > 1 and component is not None and not facts.label_table
    box = ", ".join(f"{name} {_numbers(ends, ' to ')}" for name, *ends in zip("xyz", *facts.world_box, strict=True))
    matrix = [] if facts.direction.startswith("axis-aligned") else facts.direction_matrix
    return [
        facts.name,
        f"  shape        {_numbers(facts.shape, ' x ')} voxels (x, y, z)",
        f"  type         {facts.dtype}, {_memory_text(facts.bytes)}{place}",
        f"  spacing      {_numbers(facts.spacing, ' x ')}{length}{replaced}",
        f"  world size   {_numbers(facts.world_size, ' x ')}{length}",
        f"  world box    {box}{length}",
        f"  origin       {_numbers(facts.origin)} (centre of the first voxel)",
        f"  direction    {facts.direction}",
        *(f"               [{'  '.join(f'{value:8.5f}' for value in row)}]" for row in matrix),
        *(["  world axes   to the left, to the back and up in a body (LPS)"] if facts.world_axes else []),
        *([f"  time         {_time_text(facts.time)}"] if facts.time else []),
        *(f"{'' if k else '  levels':<14} {_level(k, each)}" for k, each in enumerate(facts.levels)),
        *([f"  stored       {_memory_text(facts.stored_bytes)}"] if facts.stored_bytes is not None else []),
        f"  values       {low} to {high}{value}, mean {mean}",
        "  percentiles  " + "   ".join(f"{p}%: {_number(value)}" for p, value in facts.percentiles.items()),
        *([f"  sample       {_sample_text(facts)}"] if facts.sampled_voxels else []),
        f"  fingerprint  {facts.fingerprint}",
        *(f"{'' if k else '  channels':<14} {_channel(k, each)}" for k, each in enumerate(facts.channels)),
        *([f"               values here are of component {component}; {_ALL_COMPONENTS}"] if is_one_of_several else []),
        "",
        "  voxels by value, logarithmic",
        *_histogram(facts, marks),
    ]


def _sample_text(facts: _VolumeFacts) -> str:
    num = math.prod(facts.shape) - facts.without_data
    return f"mean, percentiles and histogram are of {facts.sampled_voxels} of {num} voxels; the range is of all"


def _level(number: int, level: VolumeLevel) -> str:
    """Return the number of a level of a store, its shape, its chunks and the bytes of its decoded voxels."""
    shape, chunks = _numbers(level.shape, " x "), _numbers(level.chunks, " x ")
    read = ", which is read" * level.is_read
    return f"{number}: {shape} voxels in chunks of {chunks}, {_memory_text(level.num_bytes)}{read}"


def _channel(number: int, channel: Channel) -> str:
    """Return the number of a component, the name, colour and window that its file states, and whether it is hidden."""
    color = channel.color and "#" + "".join(f"{round(255 * part):02x}" for part in channel.color)
    window = channel.window and _numbers(channel.window, " to ")
    hidden = "(not shown)" if channel.is_hidden else ""
    known = " ".join(filter(None, (printable(channel.name), color, window, hidden)))
    return f"{number}: {known or 'no name, no color'}"


def _suggestion_lines(suggestion: Suggestion, facts: _VolumeFacts) -> Iterator[str]:
    from renderer.statistics import format_percent

    yield ""
    yield f"  looks like   {suggestion.kind}: {suggestion.reason}"
    yield from (f"               {note}" for note in suggestion.outlier_notes)
    if facts.label_table:
        yield from ("", "  labels", *_label_lines(facts.label_table, math.prod(facts.shape)))
    for k, shown in enumerate(() if facts.label_table else suggestion.visible):
        voxels, share = (f"{format_percent(part)} of the" for part in (shown.voxels, shown.share))
        values = " and ".join(f"{_number(low)} to {_number(high)}" for low, high in shown.ranges)
        hidden = ", hidden" * (shown.share < _HIDDEN < shown.voxels)
        yield f"{'' if k else '  shows':<14} {shown.name}, {values}: {voxels} voxels, {share} picture{hidden}"
    yield ""
    yield from transfer_lines(suggestion.transfer, suggestion.notes)


def _label_lines(table: list[_LabelFacts], num_voxels: int) -> Iterator[str]:
    """Yield a line for each label; if there are more than _MAX_LABELS, for the largest ones."""
    from renderer.statistics import format_percent

    is_long, is_named = len(table) > _MAX_LABELS, any(label.name for label in table)
    rows = [["label", "name", "voxels", "volume", "picture"]]
    for label in sorted(table, key=attrgetter("voxels"), reverse=True)[:_MAX_LABELS] if is_long else table:
        hidden = ", hidden" * (label.share < _HIDDEN < label.voxels / num_voxels)
        amounts = [str(label.voxels), _number(label.volume), f"{format_percent(label.share)}{hidden}"]
        rows.append([str(label.value), label.name, *amounts])
    shown = rows if is_named else [[row[0], *row[2:]] for row in rows]
    yield from (f"    {line}" for line in format_table(shown, {0, 1 + is_named, 2 + is_named}).split("\n"))
    yield from [f"    and {len(table) - _MAX_LABELS} more"] * is_long


def _histogram_marks() -> str:
    """Return characters for bars: block characters if the terminal's encoding has them, else ASCII ones."""
    try:
        _BLOCKS.encode(sys.stdout.encoding or "ascii")
    except (UnicodeEncodeError, LookupError):
        return _ASCII
    return _BLOCKS


def _histogram(facts: _VolumeFacts, marks: str) -> list[str]:
    """Return the lines of a histogram of `log1p(count)`, with counts at the left of its bars and values below them."""
    import numpy as np

    counts = np.array(facts.histogram["counts"])
    fullest = int(counts.max())
    steps = len(marks) - 1
    heights = np.ceil(np.log1p(counts) / np.log1p(fullest) * _ROWS * steps).astype(int)
    heights = heights.repeat(max(1, _COLUMNS // len(counts)))
    margin = len(str(fullest))
    lines = []
    for row in range(_ROWS - 1, -1, -1):
        label = {_ROWS - 1: str(fullest), 0: "1"}.get(row, "")
        bars = "".join(marks[level] for level in np.clip(heights - row * steps, 0, steps))
        lines.append(f"    {label:>{margin}} {bars}".rstrip())
    low, high, width = facts.minimum, facts.maximum, len(heights)
    left, middle = (_number(low), _number(low / 2 + high / 2)) if high > low else ("", "")
    third = width // 3
    lines.append(f"{'':{margin + 5}}{left:<{third}}{middle:^{width - 2 * third}}{_number(high):>{third}}")
    return lines
