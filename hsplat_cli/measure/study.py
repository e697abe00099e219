"""Measures a sweep of settings on one scene, and writes its report."""

from __future__ import annotations

import datetime
import time
from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from hsplat_cli.measure.report import REPORT_FILES, write_study
from hsplat_cli.measure.sweep import (
    Measurement,
    PlannedSetting,
    Study,
    Truths,
    measure_setting,
    plan_sweep,
    splat_setting,
)
from hsplat_cli.measure.sweep_options import Sweep
from hsplat_cli.measure.tables import terminal_table
from hsplat_cli.measure.tolerance import find_truth, nothing_visible_error, open_at_any_tolerance
from hsplat_cli.terminal import FilmEvents, Reporter, describe_machine
from renderer.accuracy import (
    NUM_SAMPLED_PIXELS,
    Truth,
    is_loop,
    require_measuring_packages,
    sample_truths,
    spread_evenly,
    with_a_neighbour,
)
from renderer.draw import Rasterizer, open_rasterizer
from renderer.errors import HsplatError
from renderer.film import locked_files, require_writable_dry_run
from renderer.frame import FilmStage, read_film_volumes
from renderer.scene import (
    CameraPath,
    FilmScene,
    Motion,
    Scene,
    SplatSpec,
    counted,
    relative_path,
    scene_to_dict,
    schedule_to_dict,
    with_files,
)
from renderer.system import num_cores
from renderer.volume import Volume, joint_fingerprint

# The number of frames that are measured if the user gives none.
_NUM_FRAMES = 3

# The settings to measure, grouped by the pyramid that they share.
Plan = Sequence[Sequence[PlannedSetting]]


@dataclass(frozen=True)
class StudyRequest:
    """Describes a requested study: the scene, the settings and the frames to measure.

    name: the name of the scene's file.
    sweep: the error measures, footprints and tolerances to measure.
    frames: the frames to measure; None for a few frames spread over the path.
    repeats: the largest number of timed passes of a setting.
    truth_tolerance: the tolerance with which exact rays are computed.
    folder: the folder of the report.
    is_quick: whether pictures are compared with a few exact rays in place of whole exact pictures. The sweep then has
        one footprint and one error measure.
    """

    name: str
    scene: FilmScene
    sweep: Sweep
    frames: list[int] | None
    repeats: int
    truth_tolerance: float
    folder: Path
    is_quick: bool = False


class _Openers(NamedTuple):
    """Holds the functions that open the stage and the rasterizer of a scene."""

    stage: Callable[[FilmScene], AbstractContextManager[FilmStage]]
    rasterizer: Callable[[FilmScene], AbstractContextManager[Rasterizer]]


def run_study(request: StudyRequest, reporter: Reporter) -> None:
    """Measure all settings, write the report and print its table.

    After an interrupt or an error, the finished measurements are reported; then the exception is raised again.
    """
    _require_all(request)
    with locked_files([request.folder / name for name in REPORT_FILES]):
        _run_study(request, reporter)


def _run_study(request: StudyRequest, reporter: Reporter) -> None:
    scene = request.scene
    machine = describe_machine(_devices(request))  # a missing device fails here, before a voxel is read
    volumes = read_film_volumes(scene).first
    volume = volumes[0]
    camera = scene.at(0).camera
    frames = request.frames or _frames(camera.path, camera.num_frames, is_quick=request.is_quick)
    sweep = request.sweep
    measurements: list[Measurement] = []
    end: KeyboardInterrupt | HsplatError | None = None
    with _openers(request, volumes) as opened:
        plan = plan_sweep(scene, opened.stage, sweep.errors, sweep.splats, sweep.tolerances)
        with opened.stage(scene) as stage, FilmEvents(reporter, scene.primitive_name) as events:
            if request.is_quick:
                truths = _sample_truths(request, opened, plan, frames)
            else:
                truths = [find_truth(stage, request.truth_tolerance, events, frame) for frame in frames]
        if not any(truth.shows_volume for truth in truths):
            raise nothing_visible_error(len(truths))
        drawn = _measure_hsplat(request, plan, opened, truths)
        work = [each.predicted_seconds(len(frames), request.repeats) for settings in plan for each in settings]
        try:
            for measurement in _with_progress(drawn, work, reporter):
                measurements.append(measurement)
        except (KeyboardInterrupt, HsplatError) as error:
            end = error
    if measurements:
        notes = scene_notes(scene, is_quick=request.is_quick)
        if end:
            why = f"ended by an error ({end.what})" if isinstance(end, HsplatError) else "interrupted"
            notes.insert(0, f"{why}: {counted(len(measurements), 'setting')} had been measured")
        study = Study(
            name=request.name,
            scene=with_files(scene_to_dict(scene), lambda _, file: relative_path(file, request.folder)),
            volume={
                "name": Path(volume.name).name,
                "fingerprint": joint_fingerprint(volumes),
                "dtype": str(volume.values.dtype),
                "shape": volume.shape_xyz,
            },
            machine=machine,
            truth_tolerance=request.truth_tolerance,
            truths=tuple(truth for truth in truths if isinstance(truth, Truth)),
            measurements=tuple(measurements),
            notes=tuple(notes),
        )
        _report(study, request.folder, reporter)
    if end:
        raise end


def _frames(path: CameraPath, num_frames: int, *, is_quick: bool) -> list[int]:
    """Return the frames that are measured if the user gives none.

    Unless the study is quick, two of them are neighbours, because flicker is measured between neighbouring frames.
    """
    frames = spread_evenly(range(num_frames), _NUM_FRAMES, is_loop=is_loop(path))
    return frames if is_quick else with_a_neighbour(frames, num_frames)


def _require_all(request: StudyRequest) -> None:
    """Raise InputError if a package is missing, or the report cannot be written."""
    if not request.is_quick:
        require_measuring_packages()
    for name in REPORT_FILES:
        require_writable_dry_run(request.folder / name)


def _with_splat(scene: Scene, splat: SplatSpec) -> Scene:
    return replace(scene, splat=splat)


def _devices(request: StudyRequest) -> str:
    """Return the devices that draw the footprints of a sweep. Raises RenderError if OpenGL is needed and missing."""
    devices = []
    for splat in request.sweep.splats:
        with open_rasterizer(request.scene.changed(partial(_with_splat, splat=splat))) as rasterizer:
            devices.append(rasterizer.device)
    return " and ".join(dict.fromkeys(devices))


@contextmanager
def _openers(request: StudyRequest, volumes: Sequence[Volume]) -> Iterator[_Openers]:
    """Yield the functions that open the stage and the rasterizer of a scene.

    In a quick study, they always return the same stage and rasterizer, because settings differ only in tolerance.
    """
    scene = request.scene
    opened = _Openers(partial(open_at_any_tolerance, volumes=volumes), open_rasterizer)
    if request.is_quick:
        with opened.stage(scene) as stage, opened.rasterizer(scene) as rasterizer:
            yield _Openers(lambda of: nullcontext(replace(stage, scene=of)), lambda _: nullcontext(rasterizer))
    else:
        yield opened


def _sample_truths(request: StudyRequest, opened: _Openers, plan: Plan, frames: Sequence[int]) -> Truths:
    """Compute the truth at some pixels of each frame, chosen by pictures at the middle tolerance of the sweep."""
    scene = plan[0][len(plan[0]) // 2].scene
    with opened.stage(scene) as stage, opened.rasterizer(scene) as rasterizer:
        return sample_truths(
            stage, frames, request.truth_tolerance, rasterizer, clock=time.perf_counter, num_threads=num_cores()
        )


def _with_progress(drawn: Iterator[Measurement], work: Sequence[float], reporter: Reporter) -> Iterator[Measurement]:
    """Yield the measurements, and show their progress. work: the predicted seconds of each measurement."""
    with reporter.progress(work, label="measuring", unit="settings") as bar:
        for measurement in drawn:
            yield measurement
            bar.advance(f"{measurement.setting.series}, {measurement.setting.label}")


def _measure_hsplat(request: StudyRequest, plan: Plan, opened: _Openers, truths: Truths) -> Iterator[Measurement]:
    """Yield the measurements of all settings, pyramid by pyramid, with one open stage at a time.

    Settings with equal pictures are measured once. Each setting gets a new OpenGL context, unless the study is quick: a
    software driver keeps the memory of its largest picture, which would count for all later settings.
    """
    measured: dict[Hashable, Measurement] = {}
    for settings in plan:
        with opened.stage(settings[0].scene) as stage:
            for planned in settings:
                scene, key = planned.scene, planned.picture_key()
                if key not in measured:
                    with opened.rasterizer(scene) as rasterizer:
                        measured[key] = measure_setting(
                            replace(stage, scene=scene),
                            truths,
                            rasterizer,
                            clock=time.perf_counter,
                            repeats=request.repeats,
                        )
                setting = splat_setting(scene.error, planned.splat)
                yield replace(measured[key], setting=setting, pyramid_seconds=stage.seconds["pyramid"])


def _report(study: Study, folder: Path, reporter: Reporter) -> None:
    """Write the report, and print its table and notes."""
    paths = write_study(study, folder, date=datetime.date.today().isoformat())
    reporter.result(terminal_table(study))
    for note in study.notes:
        reporter.result(f"note: {note}")
    reporter.result("written: " + ", ".join(map(str, paths)))


def scene_notes(scene: FilmScene, *, is_quick: bool = False) -> list[str]:
    """Return notes that say how the settings are measured, and how they differ from the scene.

    is_quick: as in StudyRequest.
    """
    notes, here = [], "here each tolerance is measured by itself"
    if is_quick:
        has_light, num = scene.at(0).light is not None, NUM_SAMPLED_PIXELS
        probes = f"paths of light through {num} pixels" if has_light else f"{num} exact rays"
        notes.append(
            f"errors are estimates from {probes} of each frame, with intervals that hold the error of all pixels in "
            "95 % of cases or more; every picture was drawn once, so times are less sure"
        )
    if scene.error.goal is not None:
        (schedule,) = schedule_to_dict(scene.error)
        notes.append(f"the scene asks for error.{schedule}, not for a tolerance; {here}")
    elif isinstance(scene.error.tolerance, Motion):
        notes.append(f"the scene changes its tolerance over the film; {here}")
    if scene.output.background is None:
        notes.append("the scene's background is transparent; pictures are compared over black")
    return notes
