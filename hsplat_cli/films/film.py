"""One film: frames that are kept as they come, and the file that is made of them."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from hsplat_cli.executors import CrewSpec, Drawer, Drawn, open_crew
from hsplat_cli.films.behind import in_turn, one_behind
from hsplat_cli.films.done import Done, record, tell
from hsplat_cli.films.goals import make_plan
from hsplat_cli.films.kept import find_kept, tell_kept, tell_left
from hsplat_cli.films.place import taken
from hsplat_cli.films.record import makers, with_seconds
from hsplat_cli.films.start import start_film
from hsplat_cli.scenes import Job
from hsplat_cli.terminal import counted, deferrable_interrupts, progress
from renderer.errors import RenderError
from renderer.film import (
    FilmWriter,
    KeptFrames,
    Record,
    forget_frames,
    has_frame_files,
    open_film,
    require_encoder,
    sidecar_path,
)
from renderer.frame import CostLog, Details


def render_once(
    job: Job,
    crew_spec: CrewSpec,
    *,
    place: Path | None = None,
    on_begin: Callable[[], None] | None = None,
    force: bool = False,
    quiet: bool,
    in_passing: bool = False,
) -> RenderError | None:
    """The film that the scene asks for, in one pass; what was asked for and not had.

    Frames that an earlier job finished are kept; with `force` they are drawn again.
    place: the folder of what is not finished, where the caller has taken the place of the output.
    on_begin: called where the film is not there yet, before anything of it is.
    in_passing: the film is a means to another end, in a new folder: nothing is said of it but how far the work is.
    """
    start, output, frames = time.perf_counter(), job.scene.output, job.frames
    with contextlib.ExitStack() as stack:
        # What can fail early does: the outputs, the encoder, and GL or a cluster are tried before a voxel is read.
        folder = place or stack.enter_context(taken(output, frames, sidecar_path(job.scene, frames)))
        defer_interrupts = stack.enter_context(deferrable_interrupts())
        require_encoder(output)
        crew = stack.enter_context(open_crew(crew_spec, job.scene, quiet=quiet))
        begun = start_film(job, folder, crew.gl, force=force, quiet=quiet)
        if begun is None:
            return None
        if on_begin is not None:
            on_begin()
        plan = make_plan(Details(begun.stage, CostLog()), frames, crew.rasterizer, quiet=quiet)
        job, cause, before = begun.job, begun.cause, begun.before
        del begun  # its volume may move
        kept = find_kept(job, plan, folder, cause, before, force=force)
        if not quiet:
            tell_kept(kept, job, plan)
        num_kept = len(kept.records)
        label = "drawing" if in_passing else output.file.name
        try:
            with crew.drawer(plan, len(frames) - num_kept) as drawer:
                by_clock = plan.by_clock
                del plan  # its volume may move
                records, notes = _draw(
                    job, kept, drawer, folder, defer_interrupts, by_clock=by_clock, label=label, quiet=quiet
                )
                plan = drawer.plan
                notes = [*notes, *drawer.notes]
                made_by = list(dict.fromkeys([*makers(records), *drawer.made_by])) or [crew.gl]
            seconds = time.perf_counter() - start
            done = Done(job, plan, records, notes, made_by, seconds, num_kept)
            record(done, folder, cause)
        except BaseException:
            if not (quiet or in_passing):
                tell_left(kept, job, folder, cause, force=force)
            raise
        forget_frames(folder, output, frames)
    tell(done, quiet=quiet or in_passing)
    return done.shortfall


def _draw(
    job: Job,
    kept: KeptFrames,
    drawer: Drawer,
    folder: Path,
    finishing: Callable[[], None],
    *,
    by_clock: bool,
    label: str,
    quiet: bool,
) -> tuple[list[Record], Sequence[str]]:
    """Draw the frames that are not there, keep them, and make the film of all; their records, and notes on the film."""
    output = job.scene.output
    missing = [number for number in job.frames if number not in kept.records]
    records: list[Record] = []
    notes: Sequence[str] = ()
    with contextlib.ExitStack() as stack:
        film = None
        if not has_frame_files(output):
            film = stack.enter_context(open_film(output, job.frames, within=folder, finishing=finishing))
            notes = film.notes
        bar = stack.enter_context(progress(len(missing), label=label, quiet=quiet))
        drawing = stack.enter_context(contextlib.closing(drawer.draw(missing)))
        missed = frozenset(missing)
        tasks = (partial(_store, kept, film, n, next(drawing) if n in missed else None) for n in job.frames)
        stored = in_turn(tasks) if by_clock else one_behind(tasks)
        for record in stack.enter_context(contextlib.closing(stored)):
            records.append(record)
            if record["frame"] in missed:
                bar.advance(counted(record["splats"], job.scene.splat.noun))
    if film is None:
        finishing()
    return records, notes


def _store(kept: KeptFrames, film: FilmWriter | None, number: int, drawn: Drawn | None) -> Record:
    """Keep a frame that was drawn, or take the one that is kept, for the film, too; its record."""
    before = time.perf_counter()
    record = kept.records[number] if drawn is None else kept.keep(number, drawn.picture.png, drawn.record)
    if film is not None:
        picture = kept.picture(number) if drawn is None else drawn.picture
        film.write(number, picture.pixels)
    if drawn is None and film is None:
        return record
    return with_seconds(record, encode=time.perf_counter() - before)
