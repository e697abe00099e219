"""Take the transfer function from a named preset, or from a file of another program."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from renderer.errors import Problem, SceneError, closest_match
from renderer.scene import TRANSFER_FUNCTION_SECTION, ControlPoint, TransferSpec, schema
from renderer.statistics import VoxelSample, find_background, top_value
from renderer.suggest.film_options import PRESET_WORDS
from renderer.suggest.presets import SHADING
from renderer.suggest.recognition import offset_text
from renderer.suggest.suggestion import LEAST_OPACITY, Suggestion, transparent_between
from renderer.suggest.wishes import LABELS_WISH, WISHES

# A transfer function suits a volume if the volume's values cover at least this share of the range of values that the
# function shows.
_LEAST_COMMON = 0.5


def imported_suggestion(sample: VoxelSample, zero: float | None, wish: str) -> Suggestion:
    """Return a suggestion with the transfer function of a preset or a file.

    A function given in shares of a range is stretched over the values above the middle of the background. A function
    given in values is shifted by `zero`, the stored value of 0 Hounsfield units; if `zero` is None, a note says if the
    function's values do not fit the volume's. wish: the name of the preset or the path of the file; `file#NAME` picks
    one function of a file. Raises SceneError if the function cannot be read.
    """
    file, _, name = wish.partition("#")
    given: dict[str, Any] = {"import": file} | ({"name": name} if name else {})
    if zero:
        given["shift"] = zero
    found, problems = _parsed(given)
    background = find_background(sample)
    ends = (background.middle, top_value(sample))
    span = [sample.round_value(sample.denormalize(end)) for end in ends]
    is_share = [problem.path for problem in problems] == ["range"]
    if is_share:
        found, problems = _parsed({**given, "range": span, "shift": 0.0})
    if problems:
        raise SceneError([_at_option(problem, wish) for problem in problems])
    imported = found.imported
    assert imported is not None
    points = [
        replace(point, value=float(f"{point.value:.9g}"), opacity=round(point.opacity, 6)) for point in found.points
    ]
    notes = [f"not imported: {clause}" for clause in imported.left_out]
    if not is_share and zero is None:
        notes += _misfits([(point.value, point.opacity) for point in points], imported.name, span)
    if zero is None and background.is_there and _opacity_at(points, span[0]) > LEAST_OPACITY:
        points = transparent_between(points, *map(sample.denormalize, (background.low, background.high)))
        notes.append(f"{imported.name} shows values near {span[0]:g}, which are the background here and are left out")
    return Suggestion(
        f"shown as --preset {wish}",
        f"values and opacities are those of {imported.name}{offset_text(zero)}",
        replace(found, mapping=tuple(points)),
        ("",) * len(points),
        replace(SHADING, **imported.shading, occlusion=0.0) if imported.shading else SHADING,
        outlier_notes=tuple(notes),
    )


def _opacity_at(points: Sequence[ControlPoint], value: float) -> float:
    return float(np.interp(value, [point.value for point in points], [point.opacity for point in points]))


def _misfits(points: Sequence[tuple[float, float]], name: str, span: Sequence[float]) -> Iterator[str]:
    """Yield a note if the object's values cover too little of the range that a transfer function shows.

    points: the function's pairs (value, opacity). name: the name of the function. span: the lowest and the highest
    value of the object.
    """
    seen = [(first, last) for (first, before), (last, after) in pairwise(points) if before or after]
    low, high = (seen[0][0], seen[-1][1]) if seen else span
    if span[0] < span[1] and low < high and min(high, span[1]) - max(low, span[0]) < _LEAST_COMMON * (high - low):
        scale = (span[1] - span[0]) / (high - low)
        yield (
            f"{name} is made for values from {low:g} to {high:g}, and most here lie from {span[0]:g} to {span[1]:g}; "
            f"in a scene, `import: {name}` with `shift: {span[0] - scale * low:.4g}` and `scale: {scale:.4g}` fits them"
        )


def _parsed(given: dict[str, Any]) -> tuple[TransferSpec, list[Problem]]:
    problems: list[Problem] = []
    return TRANSFER_FUNCTION_SECTION.read(schema.TreeNode(given, "", problems)), problems


def _at_option(problem: Problem, wish: str) -> Problem:
    expected, hint = problem.expected, problem.hint
    if problem.path == "name" and "#" not in wish:
        hint = f"preset {wish}#NAME picks one"
    elif not Path(wish.partition("#")[0]).suffix:
        close = closest_match(wish, PRESET_WORDS) if hint is None else None
        expected = f"{', '.join(WISHES)} or {LABELS_WISH}; a file; or a preset, {expected}"
        hint = f"did you mean {close}?" if close else hint
    return replace(problem, path="", location=f"preset {wish}", expected=expected, hint=hint)
