"""`hsplat info VOLUME`: what is in a file, and where a transfer function might begin."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from renderer.errors import InputError
from renderer.scene import FileSource, RawSource, VolumeSpec

if TYPE_CHECKING:
    from renderer.statistics import Statistics, ValueRange
    from renderer.volume import Float64, Volume

_COLUMNS, _ROWS = 64, 8
_BLOCKS, _ASCII = " ▁▂▃▄▅▆▇█", " .:|#"

# Colours and opacities of the suggested transfer function: a translucent hull around a dense core. What has no other
# material inside it or around it gets an opacity between the two.
_HULL, _CORE, _ALONE_OPACITY = ("#6680e6", 0.01), ("#ffe6b3", 0.5), 0.2


def _three(kind: type[int] | type[float]) -> Callable[[click.Context, click.Parameter, str | None], Any]:
    """A callback that makes three positive numbers of `128,96,114`."""

    def convert(_context: click.Context, _parameter: click.Parameter, text: str | None) -> tuple[float, ...] | None:
        if text is None:
            return None
        try:
            numbers = tuple(kind(part) for part in text.split(","))
        except ValueError:
            numbers = ()
        if len(numbers) != 3 or not all(0 < number < float("inf") for number in numbers):
            raise click.BadParameter(f"{text!r} is not three positive numbers with commas between, such as 128,96,114.")
        return numbers

    return convert


@click.command()
@click.argument("volume", type=click.Path(path_type=Path))
@click.option("--time", type=int, help="Which time step, from 0, of a volume that has several.")
@click.option("--component", type=int, help="Which component, from 0, of a volume that has several.")
@click.option(
    "--nonfinite", type=click.Choice(["error", "lowest"]), default="error", help="What to do with NaN and inf."
)
@click.option(
    "--shape", metavar="X,Y,Z", callback=_three(int), help="Read a headerless file of this shape; needs --dtype."
)
@click.option("--dtype", help="Type of a headerless file's voxels: uint8, int16, float32, ...")
@click.option("--byte-order", type=click.Choice(["little", "big"]), default="little", help="Of a headerless file.")
@click.option("--spacing", metavar="X,Y,Z", callback=_three(float), default="1,1,1", help="Of a headerless file.")
@click.option("--offset", type=click.IntRange(min=0), default=0, help="Bytes to skip in a headerless file.")
@click.option("--json", "as_json", is_flag=True, help="Print the same as JSON.")
def info(
    *,
    volume: Path,
    time: int | None,
    component: int | None,
    nonfinite: Any,
    shape: tuple[int, int, int] | None,
    dtype: str | None,
    byte_order: Any,
    spacing: tuple[float, float, float],
    offset: int,
    as_json: bool,
) -> None:
    """Describe a volume: shape, place, values and histogram.

    VOLUME is a file, or a folder of slices. The last part of the output suggests ranges of values, and a transfer
    function to paste into a scene file.
    """
    from renderer.readers import read_volume  # noqa: PLC0415  (numpy, for which --help does not wait)
    from renderer.statistics import measure, suggest_ranges  # noqa: PLC0415

    if (shape is None) != (dtype is None):
        raise InputError(
            "a headerless file needs both --shape and --dtype", got="--shape" if shape is not None else "--dtype"
        )
    source: FileSource | RawSource = FileSource(volume)
    if shape is not None and dtype is not None:
        source = RawSource(volume, shape, dtype, byte_order, spacing, offset)
    read = read_volume(VolumeSpec(source, time, component, nonfinite=nonfinite))
    statistics = measure(read.values)
    facts = _facts(read, statistics, suggest_ranges(statistics))
    if as_json:
        click.echo(json.dumps(facts, indent=2))
    else:
        click.echo(_report(facts, _histogram_marks()))


def _facts(volume: Volume, statistics: Statistics, ranges: tuple[ValueRange, ...]) -> dict[str, Any]:
    """Everything that is printed, as plain data."""
    from renderer.statistics import PERCENTILES, rebin  # noqa: PLC0415

    counts, edges = rebin(statistics, _COLUMNS)
    axes = volume.world_from_index[:3, :3]
    spacing = volume.spacing
    return {
        "name": volume.name,
        "shape": list(volume.shape_xyz),
        "dtype": volume.values.dtype.name,
        "bytes": volume.values.nbytes,
        "spacing": spacing.tolist(),
        "world_size": (spacing * volume.shape_xyz).tolist(),
        "origin": volume.world_from_index[:3, 3].tolist(),
        "direction": describe_direction(axes),
        "direction_matrix": (axes / spacing).tolist(),
        "minimum": statistics.minimum,
        "maximum": statistics.maximum,
        "mean": statistics.mean,
        "percentiles": {f"{percent:g}": statistics.percentile(percent) for percent in PERCENTILES},
        "fingerprint": volume.fingerprint,
        "histogram": {"counts": counts.tolist(), "edges": edges.tolist()},
        "ranges": [
            {"name": part.name, "low": part.low, "high": part.high, "typical": part.typical, "share": part.share}
            for part in ranges
        ],
        "transfer_function": _transfer_function(ranges, float(spacing.min())),
    }


def describe_direction(axes: Float64) -> str:
    """How the index axes, the columns of a float64 [3, 3], lie in the world, in words.

    `axis-aligned`, with the axes that are swapped or run backwards; `oblique` for right angles askew; `sheared`.
    Angles below a hundredth of a degree are taken for rounding.
    """
    import numpy as np  # noqa: PLC0415

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


def _transfer_function(ranges: tuple[ValueRange, ...], unit: float) -> dict[str, Any]:
    """A `transfer_function` that hides the background: opacity rises from its border to the next material's median."""
    nested = [part.name for part in ranges] == ["background", "material 1", "material 2"]
    points: list[tuple[float, str, float]] = []
    for part in ranges:
        color, opacity = _HULL if part.name == "material 1" and len(ranges) > 2 else _CORE
        opacity = opacity if nested else _ALONE_OPACITY
        if part.name == "background":
            points += [(part.low, "#000000", 0.0), (part.high, "#000000", 0.0)]
        else:
            points += [(part.typical, color, opacity)]
        if nested and part.name == "material 1":
            points += [(part.high, color, opacity)]
    digits = _digits(ranges[0].low, ranges[-1].high)
    short = [(_short(value, digits), color, opacity) for value, color, opacity in points]
    ascending = [point for k, point in enumerate(short) if k == 0 or point[0] > short[k - 1][0]]
    return {
        "unit": float(f"{unit:.7g}"),
        "points": [{"value": value, "color": color, "opacity": opacity} for value, color, opacity in ascending],
    }


def _digits(low: float, high: float) -> int:
    """How many digits of a threshold say where it lies between two values: seven, and those that both begin with."""
    largest, extent = max(abs(low), abs(high)), high / 2 - low / 2
    return 7 + min(max(0, math.ceil(math.log10(largest / extent))), 10) if extent > 0 and largest / 2 > extent else 7


def _short(value: float, digits: int) -> int | float:
    """Integers as they are, other numbers to so many digits."""
    return int(value) if abs(value) < 2**53 and value == int(value) else float(f"{value:.{digits}g}")


def _number(value: float) -> str:
    """Six digits, whole numbers in full."""
    return str(int(value)) if value == int(value) and abs(value) < 1e15 else f"{value:.6g}"


def _numbers(values: list[float], between: str = ", ") -> str:
    return between.join(_number(round(value, 9)) for value in values)


def _report(facts: dict[str, Any], marks: str) -> str:
    size = facts["bytes"]
    lines = [
        facts["name"],
        f"  shape        {_numbers(facts['shape'], ' x ')} voxels (x, y, z)",
        f"  type         {facts['dtype']}, "
        + (f"{size / 2**20:.1f} MiB in memory" if size >= 2**20 else f"{size} bytes in memory"),
        f"  spacing      {_numbers(facts['spacing'], ' x ')}",
        f"  world size   {_numbers(facts['world_size'], ' x ')}",
        f"  origin       {_numbers(facts['origin'])} (centre of the first voxel)",
        f"  direction    {facts['direction']}",
    ]
    if not facts["direction"].startswith("axis-aligned"):
        lines += [
            f"               [{'  '.join(f'{value:8.5f}' for value in row)}]" for row in facts["direction_matrix"]
        ]
    lines += [
        f"  values       {_number(facts['minimum'])} to {_number(facts['maximum'])}, mean {_number(facts['mean'])}",
        "  percentiles  " + "   ".join(f"{p}%: {_number(value)}" for p, value in facts["percentiles"].items()),
        f"  fingerprint  {facts['fingerprint']}",
        "",
        "  voxels by value, logarithmic",
        *_histogram(facts, marks),
        "",
        "  suggested ranges",
    ]
    for part in facts["ranges"]:
        lines.append(
            f"    {part['name']:<11} {_number(part['low']):>12} to {_number(part['high']):<12} "
            f"{100 * part['share']:6.2f}% of the voxels, median {_number(part['typical'])}"
        )
    return "\n".join([*lines, "", *_yaml(facts["transfer_function"])])


def _yaml(transfer_function: dict[str, Any]) -> list[str]:
    """The transfer function in the style of the scene files: one line per point."""
    lines = ["transfer_function:", f"  unit: {transfer_function['unit']!r}", "  points:"]
    for point in transfer_function["points"]:
        lines.append(
            f'    - {{value: {_yaml_number(point["value"])}, color: "{point["color"]}", opacity: {point["opacity"]}}}'
        )
    return lines


def _yaml_number(value: float) -> str:
    """As YAML 1.1 reads it back: an exponent needs a point and a sign."""
    text = repr(value)
    mantissa, mark, exponent = text.partition("e")
    if not mark:
        return text
    return f"{mantissa if '.' in mantissa else mantissa + '.0'}e{exponent if exponent[0] in '+-' else '+' + exponent}"


def _histogram_marks() -> str:
    """Block characters where the terminal's encoding has them."""
    try:
        _BLOCKS.encode(sys.stdout.encoding or "ascii")
    except (UnicodeEncodeError, LookupError):
        return _ASCII
    return _BLOCKS


def _histogram(facts: dict[str, Any], marks: str) -> list[str]:
    """Bars of `log1p(count)`, the fullest one _ROWS high, with the counts at the left and the values below."""
    import numpy as np  # noqa: PLC0415

    counts = np.array(facts["histogram"]["counts"])
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
    low, high = facts["minimum"], facts["maximum"]
    left, middle, right = _number(low), _number(low / 2 + high / 2), _number(high)
    axis = (
        f"{left}{middle:>{max(len(middle) + 1, (len(heights) + len(middle)) // 2 - len(left))}}" if high > low else ""
    )
    lines.append(" " * (margin + 5) + axis + f"{right:>{max(len(right) + 1, len(heights) - len(axis))}}".rstrip())
    return lines
