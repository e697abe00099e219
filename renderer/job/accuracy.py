"""Search for the tolerance of an accuracy, and compute the exact pictures that it compares with."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from renderer.draw import Rasterizer
from renderer.errors import InputError, RenderError
from renderer.frame import Stage
from renderer.job.events import JobEvents
from renderer.scene import MetricTarget, Scene, counted
from renderer.system import num_cores

if TYPE_CHECKING:
    from renderer.study import FilmTolerances, ToleranceSearchResult, Trial, Truth


def search_film_tolerances(
    stage: Stage,
    frames: Sequence[int],
    want: MetricTarget,
    rasterizer: Rasterizer,
    events: JobEvents,
    on_step: Callable[[], None] = lambda: None,
) -> FilmTolerances:
    """Search for the coarsest tolerances along a film with this accuracy, and tell each trial.

    on_step: called after each trial; what it raises is passed on. Others are those of `find_film_tolerances`.
    """
    from renderer.study import find_film_tolerances

    options: dict[str, Any] = {"num_threads": num_cores(), "clock": time.perf_counter}
    tell = _trial_teller(stage, want, events, on_step)
    return find_film_tolerances(stage, frames, want, rasterizer, on_trial=tell, **options)


def _trial_teller(
    stage: Stage, want: MetricTarget, events: JobEvents, on_step: Callable[[], None]
) -> Callable[[Trial], None]:
    def tell(trial: Trial) -> None:
        on_step()
        cells = counted(trial.num_cells, stage.scene.splat.primitive_name)
        events.note(f"tolerance {trial.tolerance:g}: {want.format(trial.value)} on frame {trial.frame}, {cells}")

    return tell


def search_tolerance(
    stage: Stage,
    frames: Sequence[int],
    want: MetricTarget,
    truth_tolerance: float,
    rasterizer: Rasterizer,
    events: JobEvents,
    on_step: Callable[[], None] = lambda: None,
) -> ToleranceSearchResult:
    """Search for the coarsest tolerance with this accuracy, and tell each trial.

    Parameters are those of `find_tolerance` and `compute_truth`.
    on_step: called now and then; what it raises is passed on.
    """
    from renderer.study import find_tolerance

    def find(frame: int) -> Truth:
        return find_truth(stage, frame, truth_tolerance, events, on_step)

    clock, tell = time.perf_counter, _trial_teller(stage, want, events, on_step)
    return find_tolerance(stage, frames, want, rasterizer, find_truth=find, clock=clock, on_trial=tell)


def find_truth(
    stage: Stage, frame: int, tolerance: float, events: JobEvents, on_step: Callable[[], None] = lambda: None
) -> Truth:
    """Compute the truth of a frame, and tell how far it is; parameters as in `search_tolerance`."""
    # Imported here: the ray integral takes a while to load.
    from renderer.study import compute_truth

    def tell(share: float) -> None:
        on_step()
        events.truth_progressed(frame, share)

    start = time.perf_counter()
    truth = compute_truth(stage, frame, tolerance, num_threads=num_cores(), on_progress=tell)
    return replace(truth, seconds=time.perf_counter() - start)


def nothing_visible_error(num_frames: int) -> InputError:
    """Return the error for a volume of which no frame shows anything."""
    return InputError(
        "the scene draws nothing, so there is nothing to measure",
        got=f"{num_frames} frame{'s' * (num_frames > 1)} without anything of the volume",
        expected="a volume in view, and a transfer function that shows some of it",
        hint="`hsplat info` shows which values there are",
    )


def unreachable_accuracy_error(want: MetricTarget, worst: Trial, scene: Scene, *, where: str, hint: str) -> RenderError:
    """Return the error where no tolerance is good enough. worst: a trial at tolerance 0. hint: what to do about it."""
    level, noun = scene.error.finest_level, scene.splat.primitive_name
    drawn = f"{worst.num_cells} {noun}{'s' * (worst.num_cells != 1)}"
    limit = "docs/footprints.md says what limits it"
    if level:
        limit = f"error.finest_level: {level} lets no cell be smaller"
    return RenderError(
        "the requested accuracy is beyond full resolution",
        where=where,
        got=f"{want.format(worst.value)} on frame {worst.frame}, with {drawn} at tolerance 0",
        expected=str(want),
        hint=f"{hint}; {limit}",
    )
