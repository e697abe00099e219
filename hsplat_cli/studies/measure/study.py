"""Measure a sweep of settings on one scene, and write its report."""

from __future__ import annotations

import datetime
import time
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any

from hsplat_cli.films import find_truths, nothing_visible_error
from hsplat_cli.reports import REPORT_FILES, require_page_packages, terminal_table, write_study
from hsplat_cli.scenes import read_volume_guarded
from hsplat_cli.studies.measure.notes import monotonicity_notes, scene_notes
from hsplat_cli.studies.measure.options import Sweep
from hsplat_cli.studies.measure.tolerance import stage_at_any_tolerance
from hsplat_cli.studies.peers.vtk_peer import (
    check_vtk,
    describe_vtk,
    measure_vtk,
    vtk_settings,
    with_transparent_border,
)
from hsplat_cli.terminal import PeakMemory, Reporter, counted, describe_machine
from renderer.draw import open_rasterizer
from renderer.errors import HsplatError
from renderer.film import require_writable_dry_run, without_paths
from renderer.frame import Stage, view_of
from renderer.scene import Scene, scene_to_dict
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
    """The scene, the settings and the frames to measure.

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
        check_vtk(scene)
    reporter.announce_compilation()
    needs_opengl = any(replace(scene, splat=splat).needs_opengl for splat in request.sweep.splats)
    with open_rasterizer(needs_opengl=needs_opengl) as rasterizer:  # fails before a voxel is read
        machine = describe_machine(rasterizer.renderer_name)
    if request.peer:
        machine["peer"] = {"name": request.peer, **describe_vtk()}
    volume = read_volume_guarded(scene.volume)
    transfer = make_transfer_function(scene.transfer_function, volume.finest_spacing)
    if request.peer:
        volume = with_transparent_border(volume, transfer)
    path = scene.camera.path
    frames = request.frames or spread_evenly(range(path.frames), _NUM_FRAMES, is_loop=is_loop(path))
    stage = stage_at_any_tolerance(scene, volume)
    views = [view_of(stage, frame) for frame in frames]
    truths = find_truths(stage, frames, request.truth_tolerance, reporter)
    del stage  # keeps one pyramid at a time in memory
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
            "notes": (*notes, *monotonicity_notes(measurements)),
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
    plan = plan_sweep(
        request.scene, lambda scene: stage_at_any_tolerance(scene, volume), sweep.errors, sweep.splats, sweep.tolerances
    )
    work = [planned.predicted_seconds(len(truths), request.repeats) for planned in plan]
    peer: Iterator[Measurement] = iter(())
    if request.peer:
        background = request.scene.output.background
        settings = vtk_settings()
        work += [len(truths) * (1 + request.repeats) * _PEER_FRAME_S] * len(settings)
        peer = measure_vtk(volume, transfer, views, truths, background, settings=settings, repeats=request.repeats)
    with reporter.progress(work, label="measuring", unit="settings") as bar:
        for measurement in chain(_measure_hsplat(request, plan, volume, truths), peer):
            yield measurement
            bar.advance(f"{measurement.setting.series}, {measurement.setting.label}")


def _measure_hsplat(
    request: StudyRequest, plan: Sequence[PlannedSetting], volume: Volume, truths: Sequence[Truth]
) -> Iterator[Measurement]:
    """Measure the planned settings, with one pyramid at a time in memory; equal pictures are drawn once.

    Each setting gets a new GL context: a software driver keeps the memory of its largest picture, which would count for
    all later settings.
    """
    memory = PeakMemory()
    measured: dict[Hashable, Measurement] = {}
    stage: Stage | None = None
    for planned in plan:
        scene, key = planned.scene, planned.picture_key()
        if stage is None or _pyramid_key(stage.scene) != _pyramid_key(scene):
            stage = None
            stage = stage_at_any_tolerance(scene, volume)
        stage = replace(stage, scene=scene)
        if key not in measured:
            with open_rasterizer(needs_opengl=scene.needs_opengl) as rasterizer:
                measured[key] = measure_setting(
                    stage, truths, rasterizer, clock=time.perf_counter, memory=memory, repeats=request.repeats
                )
        setting = splat_setting(scene.error, scene.splat)
        yield replace(measured[key], setting=setting, pyramid_seconds=stage.seconds["pyramid"])


def _pyramid_key(scene: Scene) -> Hashable:
    """Return a key of the pyramid and bricks that a scene of this study uses."""
    return scene.error.measure, scene.error.of, scene.splat.footprint == "integrated"
