"""Run `hsplat verify FILM`: verify a finished film by its files, its sidecar and fresh exact rays.

Exit codes: 0 where all is right, 1 where something differs, 2 where the film could not be verified (see `main.run`).
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hsplat_cli.commands.shared_options import FILE, quiet_option
from hsplat_cli.scenes import load_film
from hsplat_cli.terminal import FilmEvents, OutputPath, Reporter, VolumePath
from renderer.errors import HsplatError, Problem
from renderer.scene import counted
from renderer.system import join_lines, num_cores

if TYPE_CHECKING:
    from renderer.job import FilmJob
    from renderer.record import FilesCheck, FinishedFilm, PicturesCheck

# The value of `--json` that stands for the standard output.
_STDOUT = Path("-")
# Largest number of problems that the text lists; JSON has all of them.
_MAX_LINES = 20


@click.command()
@click.argument("film", type=FILE)
@click.option("--volume", type=VolumePath(), metavar="FILE", help="Take the volume from this file, if it was moved.")
@click.option(
    "--precision",
    type=click.FloatRange(0.01, 100),
    default=0.5,
    show_default=True,
    metavar="DB",
    help="Measure the accuracy to this many decibels on each side.",
)
@click.option(
    "--seed",
    type=click.IntRange(1),
    default=1,
    show_default=True,
    help="Choose other pixels for the exact rays or paths by another number.",
)
@click.option(
    "--json",
    "json_file",
    type=OutputPath(dir_okay=False),
    metavar="FILE",
    help="Write the result as JSON; - prints it.",
)
@quiet_option(help="Print nothing unless something differs.")
def verify(
    *, film: Path, volume: Path | str | None, precision: float, seed: int, json_file: Path | None, reporter: Reporter
) -> None:
    """Verify a film by its sidecar; exit with 1 where it differs.

    FILM is a film, the template of its numbered frames such as frames/{frame:04}.png, or the JSON file beside them.
    verify tests whether all files that the JSON file records are there and unchanged, whether the volume is the one it
    records, and how exact the film is by fresh exact rays or paths. Nothing is drawn, and only the file of --json is
    written.
    """
    # Imported here to keep --help fast.
    from renderer.frame import read_film_volumes
    from renderer.job import open_job_stage
    from renderer.record import RayOptions, verify_files, verify_pictures

    job = load_film(film, volume)
    original = job.original
    assert original is not None, "a film has a sidecar"
    _prepare_report(json_file, job)
    files = verify_files(original, job.scene.output)
    options = RayOptions(num_cores(), seed, precision)
    try:
        with (
            FilmEvents(reporter, job.scene.primitive_name) as events,
            open_job_stage(job, read_film_volumes(job.scene)) as stage,
        ):
            pictures = verify_pictures(original, stage, files, options, events)
    except HsplatError as error:
        _write_report(
            json_file, {**_facts(job, original, files.problems), "passes": False, "error": str(error)}, reporter
        )
        if json_file != _STDOUT and files.problems:
            reporter.result(_problem_lines(files.problems))
        raise
    problems = [*files.problems, *pictures.problems]
    _write_report(json_file, _facts(job, original, problems) | _measured_facts(files, pictures), reporter)
    if json_file != _STDOUT:
        show = reporter.result if problems else reporter.line
        show(f"{job.scene.output.file}: {'; '.join(_summary(job, files, pictures))}")
        for note in [*files.notes, *pictures.notes]:
            reporter.note(note)
        if problems:
            show(_problem_lines(problems))
    if problems:
        raise click.exceptions.Exit(1)


def _summary(job: FilmJob, files: FilesCheck, pictures: PicturesCheck) -> Iterator[str]:
    """Yield the parts of the line on the result.

    They are `whole, 120 frames`, `of this volume`, and `file PSNR 43.6 dB (43.3 to 43.9), 7680 rays`.
    """
    from renderer.record import accuracy_text, flicker_text

    num = len(job.frames)
    yield "not whole" if files.problems else f"whole, {counted(num, 'frame')}"
    yield "of this volume"
    if pictures.measured is not None:
        accuracy, num_measured = pictures.measured.accuracy, pictures.measured.num_frames
        through = f" through {counted(num_measured, 'frame')}" * (num_measured < num)
        probes = "rays" if job.scene.at(0).light is None else "pixels by paths"
        yield f"{accuracy_text(accuracy)}, {accuracy.rays} {probes}{through}"
        if (flicker := flicker_text(accuracy)) is not None:
            yield flicker


def _problem_lines(problems: Sequence[Problem]) -> str:
    """Return a line for each of the first _MAX_LINES problems, and the number of further problems."""
    lines = [
        ": ".join(filter(None, (each.location, each.what, each.got)))
        + (f" (expected: {each.expected})" if each.expected else "")
        for each in problems[:_MAX_LINES]
    ]
    more = len(problems) - _MAX_LINES
    return join_lines(lines + [f"... and {more} more; --json FILE has all of them"] * (more > 0))


# The report as JSON


def _prepare_report(path: Path | None, job: FilmJob) -> None:
    """Raise InputError, before the work begins, for a path of the report that belongs to the film or its inputs.

    A path with a wrong suffix, and a path that cannot be written, are errors, too.
    """
    if path is None or path == _STDOUT:
        return
    from hsplat_cli.reports import require_report_name
    from renderer.film import require_writable

    require_report_name("--json", path, [*job.input_files(), *job.written_files.all_files()])
    require_writable(path)


def _write_report(path: Path | None, facts: dict[str, object], reporter: Reporter) -> None:
    content = f"{json.dumps(facts, indent=2, allow_nan=False)}\n".encode()
    if path == _STDOUT:
        reporter.content(content)
    elif path is not None:
        from renderer.film import write_staged

        write_staged(path, content)


def _facts(job: FilmJob, original: FinishedFilm, problems: Sequence[Problem]) -> dict[str, object]:
    """Return the facts of the JSON report that are known before the volume is read, as plain data."""
    return {
        "passes": not problems,
        "film": str(job.scene.output.file),
        "sidecar": str(original.path),
        "frames": len(job.frames),
        "problems": [
            {"where": each.location, "what": each.what, "got": each.got, "expected": each.expected, "hint": each.hint}
            for each in problems
        ],
    }


def _measured_facts(files: FilesCheck, pictures: PicturesCheck) -> dict[str, object]:
    from renderer.record import record_to_json

    measured = pictures.measured
    facts: dict[str, object] = {"notes": [*files.notes, *pictures.notes]}
    if measured is not None:
        facts |= {"accuracy": record_to_json(measured.accuracy), "is_precise": measured.is_precise}
        facts |= {"measured_frames": measured.num_frames}
    return facts
