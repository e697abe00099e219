"""Make a film: from a job and an executor to the film and its record.

This is the only film job: the command line, the Python API and clusters use it, so that each finishes films that
another one has started. It locks the output, finds out whether the film is up to date, prepares the stage, has the
frames drawn in one pass or several, and writes the film and its sidecar. It may be killed at any moment, and resumes.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path

from renderer.accuracy import NOTHING, EncodingErrors, Glance, look_ahead
from renderer.errors import RenderError
from renderer.film import Pixels, film_notes, require_encoder
from renderer.frame import (
    FilmStage,
    FilmVolumes,
    LODCostEstimator,
    annotation_notes,
    framing_note,
    prepare_stage,
    read_film_volumes,
    require_annotation,
)
from renderer.job.checkpoint import FrameCheckpoint, FrameStore, remove_checkpoint_frames
from renderer.job.events import JobEvents
from renderer.job.executor import DrawnFrame, Executor, LocalExecutor
from renderer.job.film_job import FilmJob
from renderer.job.forecast import Forecast
from renderer.job.output_writer import OutputWriter, open_output
from renderer.job.plan import FilmPlan, find_shortfall, make_plan, schedule_record
from renderer.job.trial_frames import NUM_NEIGHBOURS, film_cost, forecast_frames
from renderer.layers import placement_notes
from renderer.record import (
    BrickMemoryRecord,
    FilmFingerprint,
    FinishedFilm,
    FrameRecord,
    PassRecord,
    describe_mismatch,
    device_notes,
    film_fingerprint,
    find_finished_film,
    limit_notes,
    make_film_record,
    shortfall_notes,
    summary_parts,
    version_notes,
)
from renderer.scene import FilmScene, TimeBudget, accuracy_of, chosen_exposure_text, counted, tolerance_at
from renderer.system import deferrable_interrupts, num_cores

# The listener is told the predicted cost of a pass only if the pass takes at least this many seconds.
_LONG_S = 60.0

# A function that opens the executor for a scene, as a context manager.
OpenExecutor = Callable[[FilmScene], AbstractContextManager[Executor]]
# A function that draws and writes a film, in one pass or several.
Passes = Callable[["FilmInProgress"], "JobResult"]


@dataclass(frozen=True)
class JobResult:
    """The result of a film job: a film that was made, or was up to date.

    film: the film and its record.
    file: the path of the film, or of the template of its frames, as the job's scene gives it.
    summary: a line on the film and its cost; empty for a film that was up to date.
    volume_note: the note that the reader of the first volume made; None without one.
    shortfall: the error for an accuracy that was not reached; None if it was.
    glances: the faults of the pictures; empty for a film that was up to date, whose pictures were not looked at.
    """

    film: FinishedFilm
    file: Path
    summary: str = ""
    volume_note: str | None = None
    shortfall: RenderError | None = None
    glances: Sequence[Glance] = ()


def make_film(
    job: FilmJob, open_executor: OpenExecutor, passes: Passes, events: JobEvents, *, resumes: bool = True
) -> JobResult:
    """Lock the output and make the film of a job, or return the existing film if it is up to date.

    open_executor: a function that opens the executor for a scene.
    passes: a function that draws and writes the film: `one_pass`, or a `Refinement`.
    resumes: whether frames that an earlier job finished are kept. If not, all frames are drawn again.
    Raises OutputLockedError if another job is writing the output, InputError and RenderError if it cannot be written,
    InputError if it is one of the job's inputs, any other HsplatError, and KeyboardInterrupt.
    """
    job.require_harmless()
    with open_output(job.scene.output, job.frames, job.sidecar, resumes=resumes) as output:
        events.locked()
        start = time.perf_counter()
        # The output, the encoder, OpenGL and the cluster are tried before a voxel is read, so that errors come early.
        with open_executor(job.scene) as executor:
            before_reading = time.perf_counter()
            volumes = read_film_volumes(job.scene)
            read_seconds = time.perf_counter() - before_reading
            for volume in volumes.first:
                for each in filter(None, (volume, volume.mask)):
                    if each.note is not None:
                        events.volume_noted(f"{each.name}: {each.note}")
            placed = placement_notes(job.scene.at(0).layers, volumes.first)
            of_scene = (*job.scene.import_notes, *job.scene.level_notes)
            for note in filter(None, (*of_scene, *placed, framing_note(job.scene))):
                events.note(note)
            job, fingerprint = _with_fingerprint(job, volumes.fingerprint, executor.device)
            existing = find_finished_film(output.sidecar, events.note) if resumes else None
            if existing is not None and existing.is_up_to_date(fingerprint, output.spec, job.frames):
                return _kept_film(output, existing, fingerprint, volumes.first[0].note, events)
            with open_job_stage(job, volumes) as stage:
                why_stale = existing.why_stale(fingerprint, output.spec, job.frames) if existing else ""
                if why_stale:
                    events.note(f"{output.spec.file} {why_stale}")
                require_annotation(stage, job.frames)
                glances = look_ahead(stage, job.frames, num_threads=num_cores())
                for glance in glances:
                    events.note(glance.note)
                if (stops := stage.chosen_exposure) is not None:
                    events.note(f"exposure: {chosen_exposure_text(stops)}")
                events.prepared()
                stage.seconds["read"] += read_seconds
                film = FilmInProgress(
                    job, output, fingerprint, stage, executor, events, start, existing, glances, resumes=resumes
                )
                made = passes(film)
    return made


def forecast_film(job: FilmJob, open_executor: OpenExecutor, events: JobEvents) -> Forecast:
    """Predict the cost of a film on this machine by drawing some of its frames. No file of the film is written.

    open_executor: a function that opens the executor for a scene. Raises HsplatError, and KeyboardInterrupt.
    """
    start = time.perf_counter()
    require_encoder(job.scene.output)
    with open_executor(job.scene) as executor, open_job_stage(job, read_film_volumes(job.scene)) as stage:
        require_annotation(stage, job.frames)
        found = forecast_frames(stage, executor, job.frames, start, events)
        return replace(found, glances=look_ahead(stage, job.frames, num_threads=num_cores()))


def _kept_film(
    output: OutputWriter, existing: FinishedFilm, fingerprint: FilmFingerprint, note: str | None, events: JobEvents
) -> JobResult:
    """Return the result of a job whose film is up to date, and remove the remains of unfinished work on the film.

    note: the note that the reader of the first volume made; None without one.
    """
    # A job that was killed just after its film was complete has left a checkpoint, and the mark of an unfinished film.
    remove_checkpoint_frames(output.folder, output.spec, output.frames, of=fingerprint)
    output.remove_mark()
    events.note(f"{output.spec.file} is up to date; --force draws it again")
    return JobResult(existing, output.spec.file, volume_note=note)


def _with_fingerprint(job: FilmJob, of_volumes: str, device: str) -> tuple[FilmJob, FilmFingerprint]:
    """Return the job and the fingerprint of its film.

    A film that is made again from a sidecar keeps the original request, such as an accuracy, only if the fingerprints
    agree. If they differ, nobody has measured the new film, and the tolerances in the sidecar count as the request.

    of_volumes: the fingerprint of the volumes. device: the device that draws.
    """
    fingerprint = film_fingerprint(job.scene, job.requested, of_volumes, device)
    if job.original is None or job.original.frames_digest == fingerprint.frames_digest:
        return job, fingerprint
    job = replace(job, requested=accuracy_of(job.scene.error))
    return job, film_fingerprint(job.scene, job.requested, of_volumes, device)


def open_job_stage(job: FilmJob, volumes: FilmVolumes) -> FilmStage:
    """Return the stage of a job's film. volumes: the volumes of the film, which were read before.

    Raises InputError if the film is made again from a sidecar, and the original film shows other volumes.
    """
    if job.original is not None:
        job.original.require_volumes(volumes.fingerprint, [volume.name for volume in volumes.first])
    return prepare_stage(
        job.scene,
        clock=time.perf_counter,
        num_threads=num_cores(),
        volumes=volumes.first,
        known=volumes.known,
    )


# Drawing and writing a film in passes


@dataclass(frozen=True)
class FilmInProgress:
    """A film that is being made.

    start: the time by `perf_counter` at which the job began.
    existing: the film that the output already has; None without one, or if all frames are to be drawn again.
    glances: the faults of the pictures, found before drawing.
    resumes: whether frames that an earlier job finished are kept.
    """

    job: FilmJob
    output: OutputWriter
    fingerprint: FilmFingerprint
    stage: FilmStage
    executor: Executor
    events: JobEvents
    start: float
    existing: FinishedFilm | None
    glances: Sequence[Glance]
    resumes: bool

    def plan(self, estimator: LODCostEstimator, on_step: Callable[[], None] = lambda: None) -> FilmPlan:
        """Find the tolerances of all frames that reach the goal of the scene.

        on_step: called before each trial drawing; an error that it raises ends the search.
        """
        return make_plan(estimator, self.output.frames, lambda: self.executor.rasterizer, self.events, on_step)

    def write_frames(
        self,
        plan: FilmPlan,
        store: FrameStore,
        label: str,
        defer_interrupts: Callable[[], None],
        on_step: Callable[[], None] = lambda: None,
    ) -> list[FrameRecord]:
        """Draw the frames that the store lacks, write the film, and return the records of all frames.

        label: the name of the film, or of its pass, for the listener. defer_interrupts: called before files get their
        final names. on_step: called between two frames; an error that it raises ends the drawing.
        """

        def draw() -> Generator[DrawnFrame, None, None]:
            start = 0.0
            for num, frame in enumerate(drawing):
                try:
                    yield frame
                except Exception as error:  # the writer ends the drawing, and still takes frames in progress
                    yield drawing.throw(error)
                    yield from drawing
                    return
                on_step()
                start = start or time.perf_counter()  # the first frame does not count: it loads data for all frames
                if num == NUM_NEIGHBOURS and isinstance(self.executor, LocalExecutor):
                    self._tell_cost(len(missing) * (time.perf_counter() - start) / num)

        missing = [number for number in self.output.frames if number not in store.records]
        # On a budget of seconds, each frame is stored before the next one is drawn, since storing is part of its time.
        is_overlapped = not plan.is_timing_dependent
        with contextlib.closing(self.executor.draw(plan, missing)) as drawing:
            return self.output.write_frames(
                store, draw(), label, self.events, defer_interrupts, is_overlapped=is_overlapped
            )

    def _tell_cost(self, seconds: float) -> None:
        """Tell the listener the predicted cost of a long pass. seconds: the time to draw and store the frames."""
        if seconds >= _LONG_S:
            first = self.output.first_pictures  # without the last drawn frame, which is still being stored
            known = [(each, first[each.file][:NUM_NEIGHBOURS]) for each in self.output.shown if each.file in first]
            sizes = {each.file: film_cost(each, pictures, self.output.frames)[1] for each, pictures in known}
            self.events.predicted(Forecast(seconds, sizes))

    def finish(
        self, plan: FilmPlan, frames: Sequence[FrameRecord], *, num_resumed: int = 0, passes: Sequence[PassRecord] = ()
    ) -> JobResult:
        """Write the sidecar of the film of these frames, and return the result of the job.

        num_resumed: the number of frames that earlier jobs drew. passes: the records of the passes of the film.

        The next job sees by the fingerprint in the sidecar that the film is up to date. The sidecar gets no fingerprint
        if a single pass would have made another film: after a pass that is coarser than requested, and after a pass
        whose tolerances depend on the clock although no budget of seconds was requested.
        """
        scene, requested, devices = self.stage.scene, self.job.requested, self._devices(frames)
        shortfall = find_shortfall(plan, scene, requested, frames)
        record = make_film_record(
            plan.stage,
            frames,
            schedule_record(plan, self.job, frames, shortfall),
            devices=devices,
            notes=[*self._notes(), *device_notes(devices), *self._notes_on_original(devices)],
            seconds=time.perf_counter() - self.start,
        )
        memory = self.executor.brick_memory
        record = replace(
            record,
            volume=replace(record.volume, fingerprint=self.fingerprint.depends_on["volume"]["fingerprint"]),
            memory=None if memory is None else BrickMemoryRecord(*memory),
            passes=tuple(passes),
        )
        is_lasting = record.schedule.reproducible or isinstance(requested.goal, TimeBudget)
        fingerprint = self.fingerprint if is_lasting and not plan.is_unfinished else None
        psnrs = {frame.frame: None if frame.accuracy is None else frame.accuracy.psnr for frame in frames}

        def measure(first: Sequence[Pixels]) -> EncodingErrors:
            # The import is here because the ray integral takes a while to load.
            from renderer.accuracy import measure_encoding

            return measure_encoding(self.stage, self.output.spec, psnrs, first, num_cores())

        record = self.output.write_record(record, fingerprint, measure)
        for note in limit_notes(scene, record):
            self.events.note(note)
        summary = ", ".join(summary_parts(scene, record, num_resumed))
        film, of_volume = FinishedFilm(self.output.sidecar, record), self.stage.layers[0].volume.note
        return JobResult(film, self.output.spec.file, summary, of_volume, shortfall, self.glances)

    def _notes(self) -> Iterator[str]:
        """Yield notes for the user on the output, the annotation, the pictures and the drawing."""
        yield from film_notes(self.output.spec)
        yield from self.job.scene.level_notes
        yield from annotation_notes(self.stage)
        # The fault that nothing is visible is left out, because the notes on blank frames tell more about it.
        yield from (each.note for each in self.glances if each.word != NOTHING)
        yield from self.executor.notes

    def _notes_on_original(self, devices: Sequence[str]) -> Iterator[str]:
        """Yield notes on a film that is made again: on an accuracy that the original missed, and on other versions."""
        if self.job.original is None:
            return
        if self.job.repeats == "film":
            yield from shortfall_notes(self.job.original)
        if self.job.repeats != "nothing":
            yield from version_notes(self.job.original, " and ".join(devices))

    def _devices(self, frames: Sequence[FrameRecord]) -> Sequence[str]:
        """Return the devices that drew the frames. A frame without a device in its record was drawn by the executor."""
        elsewhere = [frame.device for frame in frames if frame.device is not None]
        return list(dict.fromkeys(elsewhere + [self.executor.device] * (len(elsewhere) < len(frames))))


def one_pass(film: FilmInProgress) -> JobResult:
    """Draw the film as the scene requests it, and write it. Until it is written, a checkpoint keeps finished frames."""
    plan, output = film.plan(LODCostEstimator(film.stage)), film.output
    if not film.resumes:
        remove_checkpoint_frames(output.folder, output.spec, output.frames)
    checkpoint = _resume_checkpoint(film, plan)
    num_resumed = len(checkpoint.records)
    with deferrable_interrupts() as defer_interrupts:
        try:
            frames = film.write_frames(plan, checkpoint, output.spec.file.name, defer_interrupts)
            made = film.finish(plan, frames, num_resumed=num_resumed)
        except BaseException:
            _tell_resumable(film, checkpoint)
            raise
        remove_checkpoint_frames(output.folder, output.spec, output.frames)
    return made


def _resume_checkpoint(film: FilmInProgress, plan: FilmPlan) -> FrameCheckpoint:
    """Return a checkpoint with the finished frames that this job would draw alike.

    The listener is told their number, and why other finished frames are drawn again.

    If the output has the sidecar of another film, this sidecar stays until the new film has its own, even while new
    frames replace frames of the other film: the new film may be made from that sidecar, whose digests show which frames
    were replaced.
    """
    output, events, fingerprint, existing = film.output, film.events, film.fingerprint, film.existing
    checkpoint = FrameCheckpoint(output.folder, output.spec, output.frames, fingerprint)
    is_same = existing is not None and existing.frames_digest == fingerprint.frames_digest
    if existing is not None and is_same and output.spec.is_frames:
        checkpoint.adopt_records(existing.record.frames)
    dropped = [number for number, record in checkpoint.records.items() if not _matches_plan(plan, record)]
    for number in dropped:
        del checkpoint.records[number]
    if checkpoint.records:
        events.note(f"{_finished_text(film, checkpoint)} already finished")
    if checkpoint.former is not None:
        why = describe_mismatch(checkpoint.former, fingerprint.depends_on)
        events.note(f"{_redrawn_text(checkpoint.num_outdated, 'of another film')}: {why}")
    if dropped:
        which = "not drawn on a time budget" if plan.is_timing_dependent else "drawn at other tolerances"
        events.note(_redrawn_text(len(dropped), which))
    return checkpoint


def _matches_plan(plan: FilmPlan, record: FrameRecord) -> bool:
    """Return whether a finished frame has the tolerance of the plan.

    On a budget of seconds, the frame may have any tolerance, but must have been drawn on a budget, too.
    """
    if plan.is_timing_dependent:
        return record.predicted_seconds is not None
    return record.tolerance == tolerance_at(plan.stage.scene.error, record.frame)


def _tell_resumable(film: FilmInProgress, checkpoint: FrameCheckpoint) -> None:
    """Tell the listener of a job that ends early how many frames are kept, and which command resumes the job."""
    file, output = film.output.spec.file, film.output
    if checkpoint.records and output.folder.is_dir():
        command = "the same command" + " without --force" * (not film.resumes)
        if not film.resumes and not output.spec.is_frames and file.exists():  # an up-to-date film would not be redrawn
            command += f", once {file} is removed,"
        film.events.note(f"{_finished_text(film, checkpoint)} kept; {command} resumes there")


def _finished_text(film: FilmInProgress, checkpoint: FrameCheckpoint) -> str:
    """Return the beginning of a sentence on the frames of a checkpoint: `1 of 5 frames is`, `4 of 5 frames are`."""
    num = len(checkpoint.records)
    return f"{num} of {counted(len(film.output.frames), 'frame')} {'is' if num == 1 else 'are'}"


def _redrawn_text(num: int, which: str) -> str:
    return f"{counted(num, 'existing frame')} {which} {'is' if num == 1 else 'are'} drawn again"
