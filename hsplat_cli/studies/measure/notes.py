"""Write the notes of a study: where measurements differ from the scene, or behave unexpectedly."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from renderer.scene import Scene, schedule_to_dict

if TYPE_CHECKING:
    from renderer.study import Measurement

# Smaller setbacks are below the digits shown.
_MIN_SETBACK = {"psnr": 0.01, "ssim": 1e-4, "flip": 1e-4}


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


def monotonicity_notes(measurements: Sequence[Measurement]) -> list[str]:
    """Return a note for each series and metric that gets worse as the tolerance falls, with the largest setback."""
    from renderer.study import METRICS, find_regressions

    series: dict[str, list[Measurement]] = {}
    for measurement in measurements:
        if "tolerance" in measurement.setting.options:
            series.setdefault(measurement.setting.series, []).append(measurement)
    notes = []
    for name, points in series.items():
        points.sort(key=lambda point: -float(point.setting.options["tolerance"]))
        for metric in METRICS.values():
            if metric.name not in _MIN_SETBACK:
                continue
            values = [point.overall.everywhere[metric.name] for point in points]
            worse = find_regressions(values, higher_is_better=metric.higher_is_better, least=_MIN_SETBACK[metric.name])
            if worse:
                at = max(worse, key=lambda i: abs(values[i] - values[i - 1]))
                unit = f" {metric.unit}" if metric.unit else ""
                times = "once" if len(worse) == 1 else f"{len(worse)} times, at most"
                notes.append(
                    f"{name}: {metric.label} gets worse as the tolerance falls, {times} from {values[at - 1]:.4g} to "
                    f"{values[at]:.4g}{unit} between {points[at - 1].setting.label} and {points[at].setting.label}"
                )
    return notes
