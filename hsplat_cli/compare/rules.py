"""Reads the limits of a comparison: a strictness, changed by a file beside the goldens and by the command line.

The file is called `compare.yaml`:

    level: cross-driver
    limits: {largest: 5}
    frames:
      frame-0007.png: {largest: 8, flip: 0.02}

A limit of the command line overrides the limit of the frame, which overrides `limits`, which overrides the level;
`none` removes a limit. A level on the command line replaces the whole file. Frames of a film are called `frame 7`.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from hsplat_cli.compare.frame_difference import COMPARISON_METRICS
from hsplat_cli.compare.picture_file import file_content, is_picture
from hsplat_cli.compare.strictness import STRICTNESSES, Limits
from renderer.accuracy import Metric
from renderer.errors import InputError, Problem, require_package
from renderer.scene import (
    MAX_SCENE_BYTES,
    TreeEditor,
    counted,
    did_you_mean,
    format_location,
    format_value,
    join_keys,
    parse_yaml_file,
    raise_problems,
    schema,
)

LIMITS_FILE = "compare.yaml"
_MISSPELLED_FILE = "compare.yml"
DEFAULT_LEVEL = "same-machine"
# Metrics that need another package: the name of the package, and the extra that installs it.
_PACKAGES = {"flip": ("flip_evaluator", "compare"), "ssim": ("skimage", "measure")}

# Changes of limits by the metric's name; None removes a limit.
LimitChanges = Mapping[str, float | None]


@dataclass(frozen=True)
class Rules:
    """Holds the limits of all frames.

    level: a key of STRICTNESSES. limits: changes for all frames. frames: changes for single frames, by name. overrides:
    changes for all frames, applied last. file: the file of limits. places: the line of the file that names a frame, by
    the frame's name. notes: notes for the user.
    """

    level: str = DEFAULT_LEVEL
    limits: LimitChanges = field(default_factory=dict)
    frames: Mapping[str, LimitChanges] = field(default_factory=dict)
    overrides: LimitChanges = field(default_factory=dict)
    file: Path = Path(LIMITS_FILE)
    places: Mapping[str, str] = field(default_factory=dict)
    notes: Sequence[str] = ()

    def limits_for(self, name: str) -> Limits:
        """Return the limits of a frame, at least one, in the order of COMPARISON_METRICS."""
        changed = {**STRICTNESSES[self.level].limits, **self.limits, **self.frames.get(name, {}), **self.overrides}
        return {figure: limit for figure in COMPARISON_METRICS if (limit := changed.get(figure)) is not None}

    @property
    def other_limits(self) -> list[str]:
        """Return texts on limits that differ from the level's: `largest 200, flip none by golden/compare.yaml`."""
        of_level = STRICTNESSES[self.level].limits
        by_file = {figure: limit for figure, limit in self.limits.items() if figure not in self.overrides}
        descriptions = []
        for changes, source in ((by_file, self.file), (self.overrides, "option")):
            others = [
                f"{figure} {'none' if limit is None else format_value(limit)}"
                for figure, limit in changes.items()
                if limit != of_level.get(figure)
            ]
            if others:
                descriptions.append(f"{', '.join(others)} by {source}")
        num_frames = sum(self.limits_for(name) != self.limits_for("") for name in self.frames)
        if num_frames:
            descriptions.append(f"limits of {counted(num_frames, 'frame')} by {self.file}")
        return descriptions

    def require_frames(self, names: Collection[str]) -> None:
        """Raise SceneError if limits name a frame that is neither compared nor a picture beside the file."""
        raise_problems(
            Problem("", "no such frame", format_value(name), hint=did_you_mean(name, names), location=place)
            for name, place in self.places.items()
            if name not in names and not (is_picture(name) and os.path.lexists(self.file.parent / name))
        )


def load_rules(
    golden: Path,
    level: str | None = None,
    overrides: Sequence[str] = (),
    option_names: tuple[str, str] = ("--level", "--limit"),
) -> Rules:
    """Load the rules from the file beside the goldens, if it exists, and from the command line.

    golden: a folder that may hold the file, or a file beside it. level: the level on the command line. overrides:
    limits as `FIGURE=VALUE`. option_names: the options of level and overrides, for messages.

    Raises InputError if the file cannot be read, and SceneError with all problems in it or the command line.
    """
    problems: list[Problem] = []
    if level is not None:
        schema.read_option(_LEVEL, level, f"{option_names[0]} {level}", problems)
    changes: dict[str, float | None] = {}
    for text in overrides:
        changes.update(_parse_override(text, option_names[1], problems))
    rules = _rules_of_file(golden if os.path.isdir(golden) else golden.parent, problems)
    raise_problems(problems)
    if level is not None:
        is_replaced = rules.limits or rules.frames
        rules = Rules(level, notes=[f"the level {level} replaces the limits of {rules.file}"] if is_replaced else [])
    rules = replace(rules, overrides=changes)
    for name in ("", *rules.frames):
        limits = rules.limits_for(name)
        if not limits:
            hint = "a comparison without limits would always pass"
            raise InputError("no metric has a limit", where=rules.places.get(name), hint=hint)
        for figure, (package, extra) in _PACKAGES.items():
            if figure in limits:
                require_package(package, extra=extra)
    return rules


def _limit(figure: Metric) -> schema.FieldType[float | None]:
    """Return the field type of a limit: a number in the metric's range, or `none`, which is read as None."""
    plain = schema.number_field(minimum=0, maximum=255 if figure.unit == "steps" else 1)
    words = " ".join(filter(None, (plain.expected, figure.unit)))
    return replace(schema.word_or({"none": None}, plain, f"{words}, or none"), empty_hint="none removes a limit")


_LEVEL = schema.choice_field(*STRICTNESSES)
_FIGURES = {name: _limit(figure) for name, figure in COMPARISON_METRICS.items()}
_LIMITS: schema.FieldType[dict[str, float | None]] = schema.section_field(_FIGURES, lambda _, given: given)
_FRAMES = schema.mapping_field(_LIMITS, "a mapping of frames to their limits", "a frame's name")


def _parse_override(text: str, option_name: str, problems: list[Problem]) -> dict[str, float | None]:
    """Parse a limit, given as `FIGURE=VALUE`; return it by the metric's name, or add a problem and return nothing."""
    name, equals, value = (part.strip() for part in text.partition("="))
    location = f"{option_name} {text}"
    if equals:
        changes: dict[str, float | None] = schema.read_option(_LIMITS, {name: value or None}, location, problems)
        return changes
    expected = f"{option_name} FIGURE=VALUE, such as largest=4"
    problems.append(Problem("", "not a limit", expected=expected, location=location))
    return {}


def _rules_of_file(folder: Path, problems: list[Problem]) -> Rules:
    path = folder / LIMITS_FILE
    for other in sorted(folder.glob("*")):
        if other.name.lower() in (LIMITS_FILE, _MISSPELLED_FILE) and other.name != LIMITS_FILE:
            raise InputError("not read under this name", where=str(other), hint=f"call it {LIMITS_FILE}")
    if not os.path.lexists(path):
        return Rules()
    tree = parse_yaml_file(file_content(path, MAX_SCENE_BYTES, "a file of limits"), path)
    found: list[Problem] = []
    table = {"level": _LEVEL, "limits": _LIMITS, "frames": _FRAMES}
    given = schema.read_fields(schema.TreeNode({} if tree.data is None else tree.data, "", found), table)
    problems += TreeEditor(tree, path).located_problems(found)
    names = given["frames"] if schema.valid_keys(given, "frames") else ()
    places = {name: format_location(path, tree.locations[join_keys("frames", name)].key) for name in names}
    return Rules(**given, file=path, places=places)
