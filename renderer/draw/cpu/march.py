"""Spans of rays in compiled loops: what `renderer.draw.cpu.extremum` needs."""

from __future__ import annotations

from typing import Any, NamedTuple

from renderer.bricks import HALO
from renderer.compiled import inline, jit, num_lanes, to_float32
from renderer.draw.constants import MAX_SAMPLE_CELL, MIN_SAMPLE_CELL
from renderer.volume import Float32, Int32, Int64

# From cells of a brick to the index of the texel at or below.
TEXEL_OFFSET = HALO - 0.5
_MIN_TEXEL, _MAX_TEXEL = MIN_SAMPLE_CELL + TEXEL_OFFSET, MAX_SAMPLE_CELL + TEXEL_OFFSET
# A span, the part of a ray inside a brick, as `_clip_rays` writes it: the first sample [3], in texels of the brick; the
# step to the next one [3]; the length of a segment, in model units; the number of the last sample.
SPAN_FLOATS = 8
_LAST = 7


class Spans(NamedTuple):
    """A list of the parts of rays inside a brick. rows: float32 [room * SPAN_FLOATS]. pixels: int32 [room].

    order: int32 [room], the numbers of spans, those with few samples first. starts: int64, for sorting.
    """

    rows: Float32
    pixels: Int32
    order: Int32
    starts: Int64


@inline
def first_and_step(origin: Any, direction: Any, way: Any, corner: float, scale: float) -> Any:
    """Return the first sample along an axis, in texels of the brick, and the step to the next one.

    way: where the first and the last sample are along the ray, and 1 / the number of intervals between samples.
    """
    begin, end, per_interval = way
    first = _clamp_to_brick((origin + begin * direction - corner) * scale + TEXEL_OFFSET)
    last = _clamp_to_brick((origin + end * direction - corner) * scale + TEXEL_OFFSET)
    return to_float32(first), to_float32((last - first) * per_interval)


@inline
def _clamp_to_brick(position: Any) -> Any:
    """Clamp positions to where a brick has texels; NaN becomes the lowest one."""
    return min(max(_MIN_TEXEL, position), _MAX_TEXEL)


@jit
def sort_spans(spans: Spans, num: int) -> None:
    """Sort spans by their numbers of samples, so that those that are marched in step end together."""
    rows, order, starts = spans.rows, spans.order, spans.starts
    if num <= num_lanes():
        for k in range(num):
            order[k] = k
        return
    largest = 0
    for k in range(num):
        largest = max(largest, int(rows[SPAN_FLOATS * k + _LAST]))
    starts[: largest + 2] = 0
    for k in range(num):
        starts[int(rows[SPAN_FLOATS * k + _LAST]) + 1] += 1
    for count in range(1, largest + 1):
        starts[count] += starts[count - 1]
    for k in range(num):
        last = int(rows[SPAN_FLOATS * k + _LAST])
        order[starts[last]] = k
        starts[last] += 1
