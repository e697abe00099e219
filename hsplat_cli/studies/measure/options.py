"""Parse the lists on the command line of `hsplat measure`: settings to sweep, and a wanted accuracy."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

from renderer.errors import InputError
from renderer.scene import ErrorSpec, MetricTarget, Scene, SplatSpec, did_you_mean, format_value, join_words

T = TypeVar("T")

# The scene file has the same limits.
_MAX_ANGULAR, _MAX_RADIAL = 64, 32

_MEASURES = {"optical": ("optical", "classified"), "rms": ("rms", "classified"), "rms:scalar": ("rms", "scalar")}
_CORRECTIONS = {"on": True, "off": False}
_NO_CORRECTION_NOTE = "the integrated footprint has no opacity correction to switch off; it is measured as it is"


@dataclass(frozen=True)
class Sweep:
    """Lists of which all combinations are measured.

    errors: one for each measure; their tolerance is ignored. splats: each footprint, corrected or not.
    tolerances: None for a choice that suits the volume. notes: on requests that were changed.
    """

    errors: tuple[ErrorSpec, ...]
    splats: tuple[SplatSpec, ...]
    tolerances: tuple[float, ...] | None
    notes: tuple[str, ...] = ()


def parse_sweep(scene: Scene, *, tolerances: str | None, footprints: str, measures: str, corrections: str) -> Sweep:
    """Parse lists with commas. Raises InputError with the name of the option."""
    are_corrected = _items("--corrections", corrections, _CORRECTIONS.get, list(_CORRECTIONS))
    footprint_names = ["gaussian", "gouraud", "gouraud:12x4", "integrated"]
    shapes = _items("--footprints", footprints, lambda word: _footprint(word, scene.splat), footprint_names)
    pairs = _items("--measures", measures, _MEASURES.get, list(_MEASURES))
    splats = [_with_correction(shape, is_on) for is_on in are_corrected for shape in shapes]
    needs_correction_note = not any(are_corrected) and any(shape.footprint == "integrated" for shape in shapes)
    return Sweep(
        errors=tuple(replace(scene.error, measure=measure, of=of) for measure, of in pairs),  # type: ignore[arg-type]
        splats=tuple(dict.fromkeys(splats)),
        tolerances=None if tolerances is None else _items("--tolerances", tolerances, _tolerance, ["0.5", "0.1", "0"]),
        notes=(_NO_CORRECTION_NOTE,) * needs_correction_note,
    )


def parse_want(text: str) -> MetricTarget:
    """Parse `psnr=38`, `rmse=0.01`, `ssim=0.95` or `flip=0.02`. Raises InputError."""
    expected = "psnr=38, rmse=0.01, ssim=0.95, flip=0.02 or other values"
    name, _, number = (part.strip() for part in text.partition("="))
    value = _number(number)
    if name not in ("psnr", "rmse", "ssim", "flip") or value is None:
        raise InputError(
            "not an accuracy that can be wanted", where="--want", got=format_value(text), expected=expected
        )
    most = 200.0 if name == "psnr" else 1.0
    if not 0 < value <= most:
        raise InputError(
            f"out of the range of {name}",
            where="--want",
            got=format_value(text),
            expected=f"more than 0 and at most {most:g}",
        )
    return MetricTarget(name, value)  # type: ignore[arg-type]


def _items(option: str, text: str, parse: Callable[[str], T | None], examples: list[str]) -> tuple[T, ...]:
    """Return the parsed words between the commas, without repetitions; `parse` returns None for an invalid one."""
    found: dict[T, None] = {}
    for word in (part.strip() for part in text.split(",")):
        item = parse(word)
        if item is None:
            raise InputError(
                "cannot be swept",
                where=option,
                got=format_value(word),
                expected=f"{join_words(examples)}, several with commas between them",
                hint=did_you_mean(word, examples),
            )
        found[item] = None
    return tuple(found)


def _footprint(word: str, splat: SplatSpec) -> SplatSpec | None:
    """Parse `integrated`, `gaussian`, `gouraud` with the scene's subdivisions, or `gouraud:AxR` with A angular and R
    radial ones."""
    if word == "integrated":
        return SplatSpec(footprint="integrated")
    if word in ("gaussian", "gouraud"):
        return replace(splat, footprint=word)  # type: ignore[arg-type]
    match = re.fullmatch(r"gouraud:(\d{1,3})x(\d{1,3})", word)
    if match is None:
        return None
    angular, radial = map(int, match.groups())
    if not (3 <= angular <= _MAX_ANGULAR and 1 <= radial <= _MAX_RADIAL):
        return None
    return replace(splat, footprint="gouraud", angular=angular, radial=radial)


def _with_correction(splat: SplatSpec, is_on: bool) -> SplatSpec:
    return splat if splat.footprint == "integrated" else replace(splat, opacity_correction=is_on)


def _tolerance(word: str) -> float | None:
    value = _number(word)
    return value if value is not None and value >= 0 else None


def _number(word: str) -> float | None:
    """Parse a finite number; return None for anything else."""
    try:
        value = float(word)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
