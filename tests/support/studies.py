"""Make studies (measurements of a scene in several settings) by hand, for tests of their reports."""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hsplat_cli.measure import FrameMeasurement, Measurement, Setting, Study, write_study
from renderer.accuracy import METRICS, Accuracy, ErrorSamples, Truth, sampled_accuracy
from renderer.truth import Convergence, PixelMeans

DATE = "2030-01-02"
NAN = float("nan")
INFINITE = float("inf")


def difference(psnr: float) -> Mapping[str, float]:
    """Return all metrics of a picture with this PSNR. The larger the PSNR, the smaller are the other errors."""
    rmse = 10 ** (-psnr / 20)
    return dict(zip(METRICS, (rmse, min(1.0, 4 * rmse), psnr, 1 - rmse, 2 * rmse, 3 * rmse, rmse), strict=True))


def accuracy(psnr: float) -> Accuracy:
    """Return an accuracy with this PSNR over all pixels, and 3 dB less over the pixels that show the volume."""
    return Accuracy(difference(psnr), difference(psnr - 3))


UNDEFINED = Accuracy(*[dict.fromkeys(METRICS, NAN)] * 2)


def measure(
    label: str,
    frame_ms: float,
    num_splats: int,
    quality: float | Accuracy,
    *,
    series: str = "gaussian, optical",
    frames: Sequence[int] = (0, 7),
) -> Measurement:
    """Return the measurement of a setting, which was drawn three times on each frame.

    frame_ms: about the milliseconds of each drawing. quality: the PSNR in dB, or a whole accuracy.
    """
    result = quality if isinstance(quality, Accuracy) else accuracy(quality)
    times = tuple(frame_ms / 1000 * part for part in (0.9, 1.0, 1.3))
    steps = {"order": tuple(t / 4 for t in times), "draw": tuple(t * 3 / 4 for t in times)}
    picture = np.full((6, 8, 3), num_splats % 251, np.uint8)
    return Measurement(
        Setting(series, label, {"precision": float(label.rsplit(maxsplit=1)[-1]), "corrected": True}),
        2 * num_splats,
        0.25,
        {"cut": (0.01, 0.011, 0.012)},
        tuple(FrameMeasurement(frame, num_splats, None, steps, result) for frame in frames),
        result,
        800_000_000,
        picture,
        picture // 2,
    )


def own_series() -> list[Measurement]:
    """Return measurements at four tolerances.

    Tolerance 0.2 is slower and less exact than 0.1, but no tolerance with fewer splats is more exact.
    """
    return [
        measure("tolerance 1", 10, 1000, 22),
        measure("tolerance 0.2", 90, 3000, 27),
        measure("tolerance 0.1", 40, 5000, 31.5),
        measure("tolerance 0", 400, 90000, 36),
    ]


def brick_series() -> list[Measurement]:
    """Return the measurements of two settings with bricks, which have cells and no splats."""
    series = "integrated, optical"
    drawn = [measure(f"tolerance {t}", ms, 20, psnr, series=series) for t, ms, psnr in ((1, 20, 30), (0, 80, 41))]
    options = {"footprint": "integrated"}
    return [
        dataclasses.replace(
            each,
            num_cells=40,
            frames=tuple(dataclasses.replace(frame, rays_per_pixel=1.25) for frame in each.frames),
            setting=dataclasses.replace(each.setting, options={**each.setting.options, **options}),
        )
        for each in drawn
    ]


def quick_series() -> list[Measurement]:
    """Return measurements whose errors are estimated from 1024 rays. In the last, no ray has an error."""
    errors = ((1, 20, 1e-3), (0.1, 80, 1e-5), (0, 300, 0.0))
    samples = [(t, ms, ErrorSamples(1024, error, 2 * error**2, 5 * error)) for t, ms, error in errors]
    return [
        dataclasses.replace(measure(f"tolerance {t}", ms, 1000, sampled_accuracy(each)), difference=None)
        for t, ms, each in samples
    ]


def study_of(measurements: Sequence[Measurement], **changes: Any) -> Study:
    """Return a study of these measurements, on an invented machine and scene. changes: other fields of the study."""
    frames = sorted({sample.frame for m in measurements for sample in m.frames})
    convergence = Convergence((0.5, 0.25), (1e-5, 3e-9), (48, 40))
    means = PixelMeans(np.full((5, 8, 3), 9 / 255), np.full((5, 8, 3), 1e-6))
    on_volume = np.arange(40).reshape(5, 8) < 16
    study = Study(
        name="engine",
        scene={"volume": {"file": "engine.nhdr"}, "output": {"size": [8, 6], "background": [0.0, 0.0, 0.0]}},
        volume={"name": "engine.nhdr", "fingerprint": "0123abcd", "dtype": "uint8", "shape": (4, 5, 6)},
        machine={"processor": "a processor", "cores": 2, "device": "llvmpipe", "commit": "abc1234",
            "versions": {"numpy": "2"}},
        truth_tolerance=1e-4,
        truths=tuple(Truth(f, means, on_volume, convergence, 12.0, 1.5) for f in frames),
        measurements=tuple(measurements),
        notes=("the error rises from tolerance 0.2 to 0.1",),
    )  # fmt: skip
    return dataclasses.replace(study, **changes)


def report_of(study: Study, date: str = DATE) -> dict[str, str]:
    """Return the texts of the files of a study's report, by their suffixes: `.csv`, `.json` and `.html`."""
    with tempfile.TemporaryDirectory() as folder:
        return {path.suffix: path.read_bytes().decode() for path in write_study(study, Path(folder), date=date)}
