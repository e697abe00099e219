"""`hsplat assemble PARTS`: a film of numbered frames that were drawn in parts, by several jobs or machines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from hsplat_cli.films import Part, find_parts
from hsplat_cli.terminal import Reporter, parse_frames, sigterm_as_interrupt
from renderer.errors import Problem, SceneError
from renderer.film import has_frame_files
from renderer.scene import FRAME_FIELD, OUTPUT_SECTION, OutputSpec, TreeNode, format_value


@click.command()
@click.argument("parts", nargs=-1, required=True)
@click.option(
    "--output",
    type=click.Path(path_type=Path),
    required=True,
    metavar="FILE",
    help="Write to this .mp4, .gif or {frame}.png.",
)
@click.option("--frames", metavar="A:B:STEP", help="Take only these frames, as Python slices them: 0:30, ::10, 7, -1.")
@click.option("--frames-per-second", type=float, metavar="RATE", help="Another rate than that of the scene.")
@click.option("--quality", type=float, metavar="0-10", help="Another quality of an MP4 than that of the scene.")
@click.option("--force", is_flag=True, help="Put together again what is there already.")
@click.option("--quiet", is_flag=True, help="Say nothing but errors.")
def assemble(
    parts: tuple[str, ...],
    output: Path,
    frames: str | None,
    frames_per_second: float | None,
    quality: float | None,
    force: bool,
    quiet: bool,
) -> None:
    """Make one film of frames that were drawn in parts.

    PARTS are folders of numbered frames, or the JSON files beside them; globs may be quoted. The film and the JSON file
    beside it are those of one `hsplat render` of the whole.
    """
    found = find_parts(parts)
    numbers = parse_frames(frames, found[0].num_frames)
    options: dict[str, tuple[Any, str]] = {"file": (str(output), f"--output {output}")}
    if frames_per_second is not None:
        options["frames_per_second"] = (frames_per_second, f"--frames-per-second {frames_per_second:g}")
    if quality is not None:
        options["quality"] = (quality, f"--quality {quality:g}")
    spec = _output_spec(found[0], options, numbers)
    with sigterm_as_interrupt():
        # Imported here: numpy takes longer to load than --help may take to answer.
        from hsplat_cli.films import assemble_film

        assemble_film(found, numbers, spec, Reporter(quiet), force=force)


def _output_spec(part: Part, options: dict[str, tuple[Any, str]], numbers: Sequence[int]) -> OutputSpec:
    """The output of the recorded scene with what the options change in it. Raises SceneError."""
    problems: list[Problem] = []
    tree = {**part.scene["output"], **{key: value for key, (value, _) in options.items()}}
    spec = OUTPUT_SECTION.read(TreeNode(tree, "output", problems))
    file_option = options["file"][1]
    if not problems and has_frame_files(spec) and len(numbers) > 1 and not FRAME_FIELD.search(spec.file.name):
        hint = f"write {spec.file.stem}-{{frame:04}}.png"
        problems.append(
            Problem("output.file", "frames need a number in their names", format_value(str(spec.file)), hint=hint)
        )
    if problems:
        places = {f"output.{key}": option for key, (_, option) in options.items()}
        raise SceneError([replace(each, location=places.get(each.path, file_option)) for each in problems])
    assert isinstance(spec, OutputSpec)
    return spec
