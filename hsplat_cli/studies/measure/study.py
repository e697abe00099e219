"""Measure a sweep of settings on one scene, and write its report."""

from __future__ import annotations

import datetime
import time
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

from hsplat_cli.reports import REPORT_FILES, require_page_packages, terminal_table, write_study
from hsplat_cli.studies.measure.options import Sweep
from hsplat_cli.studies.measure.tolerance import open_at_any_tolerance
from hsplat_cli.studies.peers import vtk_peer
from hsplat_cli.terminal import FilmEvents, Reporter, describe_machine
from renderer.draw import open_rasterizer
from renderer.errors import HsplatError
from renderer.film import require_writable_dry_run
from renderer.frame import view_of
from renderer.job import find_truth, nothing_visible_error, without_paths
from renderer.readers import read_volume
from renderer.scene import Scene, counted, scene_to_dict, schedule_to_dict
from renderer.study import (
    Measurement,
    PlannedSetting,
    Study,
    Truth,
    is_loop,
    measure_setting,
    plan_sweep,
    require_measuring_packages,
    splat_setting,
    spread_evenly,
)
from renderer.transfer import TransferFunction, make_transfer_function
from renderer.view import View
from renderer.volume import Volume

# Number of frames measured by default.
_NUM_FRAMES = 3
# Estimated seconds of a peer's frame, for the time remaining.
_PEER_FRAME_S = 0.4


@dataclass(frozen=True)
class StudyRequest:
    """A request for a study: the scene, the settings and the frames to measure.

    name: of the scene's file. frames: None for a few spread over the path. peer: "vtk" or None. folder: of the report.
    """

    name: str
    scene: Scene
    sweep: Sweep
    frames: list[int] | None
    repeats: int
    peer: str | None
    truth_tolerance: float
    folder: Path


def run_study(request: StudyRequest, reporter: Reporter) -> None:
    """Measure, write the report and print the table; an interrupt or error still writes what was measured before it."""
    scene = request.scene
    require_page_packages()
    require_measuring_packages()
    for name in REPORT_FILES:
        require_writable_dry_run(request.folder / name)
    if request.peer:
        vtk_peer.check_vtk(scene)
    reporter.announce_compilation()
    needs_opengl = any(replace(scene, splat=splat).needs_opengl for splat in request.sweep.splats)
    with open_rasterizer(needs_opengl=needs_opengl) as rasterizer:  # fails before a voxel is read
        machine = describe_machine(rasterizer.device)
    if request.peer:
        machine["peer"] = {"name": request.peer, **vtk_peer.describe_vtk()}
    volume = read_volume(scene.volume)
    transfer = make_transfer_function(scene.transfer_function, volume.finest_spacing)
    if request.peer:
        volume = vtk_peer.with_transparent_border(volume, transfer)
    path = scene.camera.path
    frames = request.frames or spread_evenly(range(path.frames), _NUM_FRAMES, is_loop=is_loop(path))
    with open_at_any_tolerance(scene, volume) as stage, FilmEvents(reporter, scene.splat.primitive_name) as events:
        views = [view_of(stage, frame) for frame in frames]
        truths = [find_truth(stage, frame, request.truth_tolerance, events) for frame in frames]
    if not any(truth.on_volume.any() for truth in truths):
        raise nothing_visible_error(len(truths))
    measurements: list[Measurement] = []
    end: KeyboardInterrupt | HsplatError | None = None
    try:
        for measurement in _measurements(request, volume, transfer, truths, views, reporter):
            measurements.append(measurement)
    except (KeyboardInterrupt, HsplatError) as error:
        end = error
    if measurements:
        notes = scene_notes(scene, has_transparent_border=request.peer is not None)
        if end:
            why = f"ended by an error ({end.what})" if isinstance(end, HsplatError) else "interrupted"
            notes.insert(0, f"{why}: {counted(len(measurements), 'setting')} had been measured")
        record: dict[str, Any] = {
            "scene": scene_to_dict(scene),
            "volume": {
                "name": volume.name,
                "fingerprint": volume.fingerprint,
                "dtype": str(volume.values.dtype),
                "shape": volume.shape_xyz,
            },
            "notes": notes,
        }
        study = Study(
            name=request.name,
            machine=machine,
            truth_tolerance=request.truth_tolerance,
            truths=tuple(truths),
            measurements=tuple(measurements),
            **(record if scene.output.record_paths else without_paths(record)),
        )
        paths = write_study(study, request.folder, date=datetime.date.today().isoformat())
        reporter.result(terminal_table(study))
        for note in study.notes:
            reporter.result(f"note: {note}")
        reporter.result("written: " + ", ".join(map(str, paths)))
    if end:
        raise end


def _measurements(
    request: StudyRequest,
    volume: Volume,
    transfer: TransferFunction,
    truths: Sequence[Truth],
    views: Sequence[View],
    reporter: Reporter,
) -> Iterator[Measurement]:
    """Measure the settings of hsplat, then those of the peer."""
    sweep = request.sweep
    open_stage = partial(open_at_any_tolerance, volume=volume)
    plan = plan_sweep(request.scene, open_stage, sweep.errors, sweep.splats, sweep.tolerances)
    work = [each.predicted_seconds(len(truths), request.repeats) for settings in plan for each in settings]
    peer: Iterator[Measurement] = iter(())
    if request.peer:
        background, repeats = request.scene.output.background, request.repeats
        settings = vtk_peer.vtk_settings()
        work += [len(truths) * (1 + repeats) * _PEER_FRAME_S] * len(settings)
        peer = vtk_peer.measure_vtk(volume, transfer, views, truths, background, settings=settings, repeats=repeats)
    with reporter.progress(work, label="measuring", unit="settings") as bar:
        for measurement in chain(_measure_hsplat(request, plan, volume, truths), peer):
            yield measurement
            bar.advance(f"{measurement.setting.series}, {measurement.setting.label}")


def _measure_hsplat(
    request: StudyRequest, plan: Sequence[Sequence[PlannedSetting]], volume: Volume, truths: Sequence[Truth]
) -> Iterator[Measurement]:
    """Measure the settings, planned by pyramid, with one stage open at a time; equal pictures are drawn once.

    Each setting gets a new GL context: a software driver keeps the memory of its largest picture, which would count for
    all later settings.
    """
    measured: dict[Hashable, Measurement] = {}
    for settings in plan:
        with open_at_any_tolerance(settings[0].scene, volume) as stage:
            for planned in settings:
                scene, key = planned.scene, planned.picture_key()
                if key not in measured:
                    with open_rasterizer(needs_opengl=scene.needs_opengl) as rasterizer:
                        measured[key] = measure_setting(
                            replace(stage, scene=scene),
                            truths,
                            rasterizer,
                            clock=time.perf_counter,
                            repeats=request.repeats,
                        )
                setting = splat_setting(scene.error, scene.splat)
                yield replace(measured[key], setting=setting, pyramid_seconds=stage.seconds["pyramid"])


def scene_notes(scene: Scene, *, has_transparent_border: bool) -> list[str]:
    """Return notes on differences between the scene and what is measured.

    has_transparent_border: whether the volume has one, for VTK.
    """
    notes = []
    if scene.error.goal is not None:
        (schedule,) = schedule_to_dict(scene.error)
        notes.append(
            f"the scene asks for error.{schedule}, not for a tolerance; here each tolerance is measured by itself"
        )
    elif len(scene.error.tolerance) > 1:
        notes.append("the scene changes its tolerance over the film; here each tolerance is measured by itself")
    if scene.output.background is None:
        notes.append("the scene's background is transparent; pictures are compared over black")
    if has_transparent_border:
        notes.append(
            "the outermost layer of voxels was made transparent, because VTK's volumes end half a voxel earlier; "
            "the truth, hsplat and VTK all draw this volume"
        )
        notes.append(
            "VTK's frames have 8 bits, and hsplat's are compared before they are rounded to that; the rounding alone "
            "limits a picture to about 59 dB where the volume is visible"
        )
    return notes
