"""Draw frames of a scene for its goldens, as `hsplat render` does, and measure how exact pictures of a frame are."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from hsplat_cli.compare.golden.record import Origin, make_origin
from hsplat_cli.compare.outcome import Nearness
from hsplat_cli.compare.picture_file import MAX_PIXELS
from hsplat_cli.scenes import SceneRequest, load_job
from hsplat_cli.terminal import FilmEvents, Reporter
from renderer.errors import InputError, RenderError
from renderer.film import Pixels, frame_path
from renderer.job import FilmJob
from renderer.record import FilmRecord
from renderer.scene import MetricTarget, TimeBudget, scene_to_dict, schedule_to_dict

_TEMPLATE = Path("frame-{frame}.png")


@dataclass(frozen=True)
class DrawnFrames:
    """Frames that were drawn.

    files: by frame. psnr: the accuracy that each frame states, in dB, if it states one: the low end of its interval, as
    a few exact rays miss the worst pixels. record: the record of the film.
    """

    files: Mapping[int, Path]
    psnr: Mapping[int, float]
    origin: Origin
    record: FilmRecord

    @property
    def flicker(self) -> float | None:
        """Return the flicker of the film, in levels of 8 bits; None if it is not known."""
        accuracy = self.record.accuracy
        return None if accuracy is None or accuracy.flicker is None else accuracy.flicker.rms


def load_golden_job(request: SceneRequest) -> FilmJob:
    """Load the job that draws all frames of a scene, or of a film's sidecar, as numbered PNG files.

    Raises InputError if its frames cannot be reproduced, as they depend on the machine's speed or on other frames, or
    if they are too large to be read again.
    """
    job = load_job(replace(request, frames=None, output=_TEMPLATE), "nothing")
    reasons = {
        TimeBudget: "frames within a time budget differ from run to run",
        MetricTarget: "frames for an accuracy depend on the other frames",
    }
    why = reasons.get(type(job.scene.error.goal))
    if why:
        (key,) = schedule_to_dict(job.scene.error)
        raise InputError(
            f"{why}, and cannot be golden",
            where=f"{request.path}: error.{key}",
            hint="render a film, and give the JSON file beside it in place of the scene: it has tolerances",
        )
    width, height = job.scene.output.size
    if width * height > MAX_PIXELS:
        got, expected = f"{width} x {height}", f"at most {MAX_PIXELS} pixels, as 8192 x 4096"
        raise InputError("too large to be compared", where=f"{request.path}: output.size", got=got, expected=expected)
    return job


@contextlib.contextmanager
def drawn_frames(job: FilmJob, frames: Sequence[int], reporter: Reporter) -> Iterator[DrawnFrames]:
    """Draw frames of a job of `load_golden_job`. The files exist until the end of the block. Raises HsplatError."""
    # Imported here: comparing files needs neither kernels nor OpenGL.
    from renderer.job import make_film, one_pass, open_local_executor

    try:
        temporary_folder = tempfile.TemporaryDirectory(prefix="hsplat-golden-")
    except OSError as error:
        hint = "set the environment variable TMPDIR to another folder"
        raise RenderError(
            "cannot create a temporary folder for frames", got=error.strerror or str(error), hint=hint
        ) from error
    with temporary_folder as folder:
        template = Path(folder) / _TEMPLATE
        output = replace(job.scene.output, file=template)
        scene = job.scene.changed(lambda each: replace(each, output=output))
        with _DrawingEvents(reporter, job.scene.primitive_name) as events:
            result = make_film(replace(job, scene=scene, frames=frames), open_local_executor, one_pass, events)
        assert result.shortfall is None, "a reproducible job has no goal to miss"
        record, volume = result.film.record, result.film.record.volume
        assert record.fingerprint is not None, "a single pass has drawn them"
        origin = make_origin(record.fingerprint.depends_on, record.scene, volume.name, volume.shape, volume.dtype)
        psnr = {each.frame: round(each.accuracy.interval[0], 2) for each in record.frames if each.accuracy is not None}
        files = {frame: frame_path(template, frame) for frame in frames}
        yield DrawnFrames(files, psnr, origin, record)


class _DrawingEvents(FilmEvents):
    """Shows only the progress of drawing frames: their files are temporary, so their names and notes are not shown."""

    def started(self, label: str, num_frames: int) -> None:
        """Show a bar for the frames, without their temporary names."""
        super().started("drawing", num_frames)

    def note(self, text: str) -> None:
        """Print nothing."""


def origin_of_scene(job: FilmJob) -> Origin:
    """Return the origin that frames would have now. Nothing is drawn; the volumes are read. The device is left open."""
    from renderer.frame import read_film_volumes
    from renderer.record import film_fingerprint

    volumes = read_film_volumes(job.scene)
    depends_on = film_fingerprint(job.scene, job.requested, volumes.fingerprint, device="-").depends_on
    first = volumes.first[0]
    return make_origin(depends_on, scene_to_dict(job.scene), first.name, first.shape_xyz, str(first.values.dtype))


def measure_nearness(job: FilmJob, pictures: Mapping[int, tuple[Pixels, Pixels]]) -> dict[int, Nearness]:
    """Measure how near two pictures of each frame are to the exact picture of the scene: the golden, and the new one.

    Both are compared with exact rays through the same pixels. pictures: by frame. The prober needs the volume, which it
    reads again.
    """
    from renderer.accuracy import MOST_DB, open_prober, psnr
    from renderer.frame import prepare_stage
    from renderer.system import num_cores

    found = dict[int, Nearness]()
    with prepare_stage(job.scene, clock=lambda: 0.0, num_threads=num_cores()) as film:
        prober = open_prober(film, num_cores())
        for frame, (old, new) in pictures.items() if prober is not None else ():
            assert prober is not None
            exact = prober.on(film.at(frame)).exact_pixels(frame, new)
            before, after = (exact.compare_image(each).samples for each in (old, new))
            surely = before.interval[1] < after.interval[0] or after.interval[1] < before.interval[0]
            old_db, new_db = (min(psnr(each.mean), MOST_DB) for each in (before, after))
            found[frame] = Nearness(old_db, new_db, surely)
    return found
