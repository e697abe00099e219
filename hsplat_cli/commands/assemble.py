"""Run `hsplat assemble PARTS`: make a film of numbered frames that several jobs or machines drew."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import click

from hsplat_cli.commands.shared_options import FRAMES_WORDS, quiet_option
from hsplat_cli.terminal import FilmEvents, Reporter, parse_frames, report_film
from renderer.errors import Problem
from renderer.scene import (
    OUTPUT_SECTION,
    OutputSpec,
    first_output,
    format_value,
    only_output,
    output_suffix,
    raise_problems,
    schema,
)

if TYPE_CHECKING:
    from renderer.record import FinishedFilm


@click.command()
@click.argument("parts", nargs=-1, required=True)
@click.option(
    "--output",
    "outputs",
    required=True,
    multiple=True,
    metavar="FILE",
    help="Write to this film, or to {frame}.png; may be given several times.",
)
@click.option("--frames", metavar="A:B:STEP", help=f"Take only these frames: {FRAMES_WORDS}")
@click.option("--frames-per-second", metavar="RATE", help="Replace the scene's rate.")
@click.option("--quality", metavar="0-10", help="Replace the scene's quality of an MP4.")
@click.option("--force", is_flag=True, help="Assemble again, even if the film is up to date.")
@quiet_option()
def assemble(
    parts: tuple[str, ...],
    outputs: tuple[str, ...],
    frames: str | None,
    frames_per_second: str | None,
    quality: str | None,
    force: bool,
    reporter: Reporter,
) -> None:
    """Make one film of frames that were drawn in parts.

    PARTS are folders of numbered frames, or the JSON files beside them; globs may be quoted. The film and its JSON file
    equal the files of one `hsplat render` of all frames.
    """
    # Imported here to keep --help fast.
    from renderer.job import assemble_film, find_parts

    found = find_parts(parts)
    numbers = parse_frames(frames, found[0].num_path_frames)
    given = {"frames_per_second": frames_per_second, "quality": quality}
    options = {key: value for key, value in given.items() if value is not None}
    spec = _output_spec(found[0], outputs, options, numbers)
    with FilmEvents(reporter, "primitive") as events:
        result = assemble_film(found, numbers, spec, events, resumes=not force)
    report_film(result, reporter)


def _output_spec(
    part: FinishedFilm, names: Sequence[str], options: Mapping[str, str], numbers: Sequence[int]
) -> OutputSpec:
    """Return the output that a part's sidecar records, with the file names and options of the command line.

    names: the values of `--output`. options: the values of other options, by the keys of the section `output`. numbers:
    the frames that are assembled. Raises SceneError.
    """
    problems: list[Problem] = []
    recorded = first_output(part.record.scene)
    first = {**only_output(recorded, output_suffix(names[0])), **options, "file": names[0]}
    tree = [first, *({"file": name, "quality": first["quality"]} for name in names[1:])]
    spec = _read(tree if len(tree) > 1 else first, problems)
    if not problems:
        problems += _picture_problems(spec, _read(recorded, []), numbers)
    for at, each in enumerate(problems):
        number, _, key = each.path.removeprefix("output.").rpartition(".")
        option = f"{key.replace('_', '-')} {options[key]}" if key in options else f"output {names[int(number or 0)]}"
        problems[at] = replace(each, location=f"--{option}")
    raise_problems(problems)
    return spec


def _read(tree: object, problems: list[Problem]) -> OutputSpec:
    spec: OutputSpec = OUTPUT_SECTION.read(schema.TreeNode(tree, "output", problems, film=schema.FilmTime(None, 1.0)))
    return spec


def _picture_problems(spec: OutputSpec, recorded: OutputSpec, numbers: Sequence[int]) -> Iterator[Problem]:
    """Yield a problem for each output file that cannot be made of the pictures of the parts."""
    for number, each in enumerate(spec.files):
        path, got = f"output.{number}.file" if spec.others else "output.file", str(each.file)
        if each.is_frames and len(numbers) > 1 and not each.is_numbered:
            hint = f"write {each.file.stem}-{{frame:04}}{each.file.suffix}"
            yield Problem(path, "frames need a number in their names", format_value(got), hint=hint)
        elif each.kind != recorded.kind:
            hint = f"draw the parts with --set output.pixel_format={'rgb48' if each.kind.depth == 16 else 'rgb24'}"
            yield Problem(path, "not made of such pictures", recorded.kind.name, each.kind.name, hint)
