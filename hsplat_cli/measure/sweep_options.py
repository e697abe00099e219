"""Parses the lists of settings, and the wanted accuracy, on the command line of `hsplat measure`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

from renderer.errors import InputError, Problem
from renderer.scene import (
    MAX_PSNR_DB,
    TOLERANCE_FIELD,
    ErrorSpec,
    MetricTarget,
    Scene,
    SplatSpec,
    raise_problems,
    schema,
)

T = TypeVar("T")

# The values of the keys `measure` and `of` in the section `error`, by the words of --measures.
_MEASURES = {"optical": ("optical", "classified"), "rms": ("rms", "classified"), "rms:scalar": ("rms", "scalar")}
# For each metric, the field type that checks the range of a wanted accuracy.
_WANTED: schema.FieldTable = {
    "psnr": schema.number_field(above=0, maximum=MAX_PSNR_DB),
    **dict.fromkeys(("rmse", "ssim", "flip"), schema.number_field(above=0, maximum=1)),
}


@dataclass(frozen=True)
class Sweep:
    """Holds the lists of a sweep, all of whose combinations are measured.

    errors: a section `error` of the scene for each error measure; its tolerance is ignored. splats: a section `splat`
    for each footprint, with and without opacity correction. tolerances: None for a choice that suits the volume.
    """

    errors: tuple[ErrorSpec, ...]
    splats: tuple[SplatSpec, ...]
    tolerances: tuple[float, ...] | None


def parse_sweep(
    scene: Scene, *, tolerances: str | None, footprints: str | None, measures: str | None, corrections: str
) -> Sweep:
    """Parse the options of a sweep, which are lists with commas.

    Raises SceneError or InputError with the name of the option.

    footprints, measures: None for the defaults that can show the scene.
    """
    footprints = footprints or ("integrated" if scene.key_for_bricks else "integrated,gaussian")
    measures = measures or ("optical" if scene.mode.is_projection else "optical,rms")
    are_corrected = [word == "on" for word in _items("--corrections", corrections, schema.choice_field("on", "off"))]
    shapes = _items("--footprints", footprints, _footprint_field(scene.splat))
    pairs = [_MEASURES[word] for word in _items("--measures", measures, schema.choice_field(*_MEASURES))]
    splats = [_with_correction(shape, is_on) for is_on in are_corrected for shape in shapes]
    if scene.key_for_bricks and any(splat.footprint != "integrated" for splat in splats):
        problem = f"splats cannot draw a scene with {scene.key_for_bricks}"
        raise InputError(problem, where="--footprints", got=footprints, expected="integrated")
    if scene.mode.is_projection and measures != "optical":
        problem = "the tolerance of a projection is a share of its colour range"
        raise InputError(problem, where="--measures", got=measures, expected="optical")
    return Sweep(
        errors=tuple(replace(scene.error, measure=measure, of=of) for measure, of in pairs),  # type: ignore[arg-type]
        splats=tuple(dict.fromkeys(splats)),
        tolerances=None if tolerances is None else _items("--tolerances", tolerances, TOLERANCE_FIELD),
    )


def parse_want(text: str) -> MetricTarget:
    """Parse a wanted accuracy: `psnr=38`, `rmse=0.01`, `ssim=0.95` or `flip=0.02`. Raises SceneError."""
    metric, _, number = (part.strip() for part in text.partition("="))
    problems: list[Problem] = []
    wanted = schema.read_option(
        schema.section_field(_WANTED, lambda _, given: given), {metric: number}, "--want", problems
    )
    raise_problems(problems)
    return MetricTarget(metric, wanted[metric])  # type: ignore[arg-type]


def _items(option: str, text: str, field: schema.FieldType[T]) -> tuple[T, ...]:
    """Return the values of a list with commas, without repetitions."""
    problems: list[Problem] = []
    found = [schema.read_option(field, word.strip(), option, problems) for word in text.split(",")]
    raise_problems(problems)
    return tuple(dict.fromkeys(found))


def _footprint_field(splat: SplatSpec) -> schema.FieldType[SplatSpec]:
    """Return the field type of a footprint: `integrated`, `gaussian`, `gouraud`, or `gouraud:AxR`.

    A and R are the numbers of angular and radial subdivisions; without them the scene's subdivisions are taken.
    """

    def parse(node: schema.TreeNode) -> SplatSpec:
        word = str(node.value)
        given = {"footprint": word}
        if word.startswith("gouraud:"):
            given["footprint"] = "gouraud"
            given["angular"], _, given["radial"] = word.removeprefix("gouraud:").partition("x")
        changes = schema.read_fields(schema.TreeNode(given, "", node.problems), schema.field_table(SplatSpec))
        return SplatSpec("integrated") if word == "integrated" else replace(splat, **changes)

    return schema.FieldType("gaussian, gouraud, gouraud:12x4 or integrated", parse)


def _with_correction(splat: SplatSpec, is_on: bool) -> SplatSpec:
    return splat if splat.footprint == "integrated" else replace(splat, opacity_correction=is_on)
