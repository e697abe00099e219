"""Run `hsplat assemble PARTS`: make a film of numbered frames that several jobs or machines drew."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from hsplat_cli.commands.options import quiet_option
from hsplat_cli.terminal import FilmEvents, Reporter, parse_frames, report_film
from renderer.errors import Problem, SceneError
from renderer.scene import (
    FRAME_FIELD,
    FRAME_SUFFIXES,
    OUTPUT_SECTION,
    OutputSpec,
    first_output,
    format_value,
    output_suffix,
    schema,
)

if TYPE_CHECKING:
    from renderer.job import Part


@click.command()
@click.argument("parts", nargs=-1, required=True)
@click.option("--output", required=True, metavar="FILE", help="Write to this film, or to {frame}.png.")
@click.option("--frames", metavar="A:B:STEP", help="Take only these frames, as a Python slice: 0:30, ::10, 7, -1.")
@click.option("--frames-per-second", metavar="RATE", help="Another rate than that of the scene.")
@click.option("--quality", metavar="0-10", help="Another quality of an MP4 than that of the scene.")
@click.option("--no-paths", is_flag=True, help="Record names and no folders.")
@click.option("--force", is_flag=True, help="Assemble again what is up to date.")
@quiet_option()
def assemble(
    parts: tuple[str, ...],
    output: str,
    frames: str | None,
    frames_per_second: str | None,
    quality: str | None,
    no_paths: bool,
    force: bool,
    reporter: Reporter,
) -> None:
    """Make one film of frames that were drawn in parts.

    PARTS are folders of numbered frames, or the JSON files beside them; globs may be quoted. The film and its JSON file
    equal those of one `hsplat render` of all frames.
    """
    # Imported here to keep --help fast.
    from renderer.job import assemble_film, find_parts

    found = find_parts(parts)
    numbers = parse_frames(frames, found[0].num_frames)
    given = {"frames_per_second": frames_per_second, "quality": quality}
    options: dict[str, tuple[Any, str]] = {"file": (output, f"--output {output}")} | {
        key: (value, f"--{key.replace('_', '-')} {value}") for key, value in given.items() if value is not None
    }
    options |= {"record_paths": (False, "--no-paths")} if no_paths else {}
    spec = _output_spec(found[0], options, numbers)
    with FilmEvents(reporter, "primitive") as events:
        film = assemble_film(found, numbers, spec, events, resumes=not force)
    report_film(film, reporter)


def _output_spec(part: Part, options: Mapping[str, tuple[Any, str]], numbers: Sequence[int]) -> OutputSpec:
    """Return the recorded output, changed by options: each a value and its text. Raises SceneError."""
    problems: list[Problem] = []
    tree = {**first_output(part.record.scene), **{key: value for key, (value, _) in options.items()}}
    if output_suffix(options["file"][0]) not in FRAME_SUFFIXES:
        tree.pop("pixel_format", None)
    spec = OUTPUT_SECTION.read(schema.TreeNode(tree, "output", problems, film=schema.FilmTime(None, 1.0)))
    if not problems and spec.is_frames and len(numbers) > 1 and not FRAME_FIELD.search(spec.file.name):
        hint, got = f"write {spec.file.stem}-{{frame:04}}{spec.file.suffix}", format_value(str(spec.file))
        problems.append(Problem("output.file", "frames need a number in their names", got, hint=hint))
    if problems:
        places = {f"output.{key}": option for key, (_, option) in options.items()}
        file_option = options["file"][1]
        raise SceneError([replace(each, location=places.get(each.path, file_option)) for each in problems])
    assert isinstance(spec, OutputSpec)
    return spec
