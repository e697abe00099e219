"""Measure how far a picture is from the truth, by RMSE, PSNR, SSIM, FLIP and Delta-E.

Pictures are compared over the scene's background, clipped to [0, 1], before quantisation. They are display-referred:
perceptual metrics take them as sRGB. The packages that compute those (the extra `measure`) are imported on use.

The truth has errors of its own, because its pixels are means of a few rays. RMSE and PSNR subtract the variances of
these means from the squared differences, which removes the errors on average; the other metrics take the truth as it
is.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.accuracy.decibels import psnr
from renderer.accuracy.estimate import ErrorSamples, pool_samples
from renderer.errors import require_package
from renderer.film import require_finite
from renderer.truth import PixelMeans
from renderer.volume import Array, Bools

FloatImage = npt.NDArray[np.floating]
# A picture with which other pictures are compared: plain colours, or means over pixels with their variances.
TruePicture = FloatImage | PixelMeans
# The metrics of a picture against the truth over some pixels, by the names of METRICS; NaN for an undefined metric. An
# estimate also has the ends of its interval, with `_low` and `_high` after the name.
ErrorMetrics = Mapping[str, float]

# The number of pixels in a degree of the field of view, for FLIP. It is FLIP's own default: a display 0.7 m wide with
# 3840 pixels, seen from 0.7 m.
FLIP_PIXELS_PER_DEGREE = 0.7 * 3840 / 0.7 * math.pi / 180
# The just noticeable colour difference in CIE 1976 L*a*b* (Mahy, Van Eycken, Oosterlinck 1994).
NOTICEABLE_DELTA_E = 2.3
# The standard deviation of the Gaussian window of SSIM, in pixels (Wang et al. 2004).
_SSIM_SIGMA_PX = 1.5
# The side of the window of SSIM, in pixels: scikit-image cuts it off after 3.5 standard deviations.
SSIM_WINDOW_PX = 11
# SSIM and FLIP at a pixel depend on pixels at most this many rows and columns away. Their widest filter is FLIP's for
# blue and yellow, which ends after 3 standard deviations of sqrt(0.04 / (2 pi^2)) degrees.
REACH_PX = 10


@dataclass(frozen=True)
class Metric:
    """A number that says how much two images differ.

    name: the name in options, files and reports. label: the name in words. unit: "dB", "steps" or "".
    higher_is_better: whether a limit of the metric is the smallest value that passes, not the largest.
    """

    name: str
    label: str
    unit: str = ""
    higher_is_better: bool = False

    def passes(self, value: float, limit: float) -> bool:
        """Return whether a value is within a limit."""
        return value >= limit if self.higher_is_better else value <= limit


@dataclass(frozen=True)
class Accuracy:
    """The metrics of a picture against the truth.

    everywhere: over all pixels. on_volume: over the pixels in which the truth shows anything of the volume.
    """

    everywhere: ErrorMetrics
    on_volume: ErrorMetrics


@dataclass(frozen=True)
class SampledAccuracy(Accuracy):
    """An accuracy that is estimated from a few exact rays: RMSE and PSNR with their intervals, only over all pixels."""

    samples: ErrorSamples


def sampled_accuracy(samples: ErrorSamples) -> SampledAccuracy:
    """Return the accuracy that is estimated from samples of the squared error."""
    low, high = samples.interval
    everywhere = {"rmse": math.sqrt(max(samples.mean, 0.0)), "rmse_low": math.sqrt(low), "rmse_high": math.sqrt(high)}
    everywhere |= {"psnr": psnr(samples.mean), "psnr_low": psnr(high), "psnr_high": psnr(low)}
    return SampledAccuracy(everywhere, {}, samples)


def measure_accuracy(picture: FloatImage, truth: TruePicture, on_volume: Bools) -> Accuracy:
    """Compute all metrics of a picture, over all pixels and over the pixels of a mask.

    picture, truth: float [h, w, 3] in [0, 1]; metrics that model the eye take them as sRGB.
    on_volume: bool [h, w], the mask; metrics over an empty mask are NaN. SSIM and FLIP depend on the surroundings of a
        pixel, which may reach beyond the mask.

    Needs the packages of `require_measuring_packages`. Raises RenderError for a value that is not finite, which FLIP
    would rate as a perfect 0.
    """
    means = _checked_means(picture, truth)
    assert on_volume.shape == picture.shape[:2], (on_volume.shape, picture.shape)
    maps = {make_map: make_map(picture, means) for make_map in {make for make, _ in _FUNCTIONS.values()}}

    def difference(pixels: Any) -> ErrorMetrics:
        return {metric.name: _reduce(of, maps[make_map][pixels]) for metric, (make_map, of) in _FUNCTIONS.items()}

    return Accuracy(difference(np.ones_like(on_volume)), difference(on_volume))


def compute_metric(name: str, picture: FloatImage, truth: TruePicture) -> float:
    """Compute one metric of METRICS over all pixels; parameters and errors as in `measure_accuracy`."""
    means = _checked_means(picture, truth)
    make_map, of = _FUNCTIONS[METRICS[name]]
    return _reduce(of, make_map(picture, means))


def metric_map(name: str, picture: FloatImage, truth: TruePicture) -> FloatImage:
    """Return the value of `ssim` or `flip` at each pixel, float64 [h, w], whose mean is the metric.

    A value depends on pixels at most REACH_PX rows and columns away. Parameters and errors as in `measure_accuracy`.
    """
    means = _checked_means(picture, truth)
    make_map, of = _FUNCTIONS[METRICS[name]]
    assert of is np.mean, name
    return make_map(picture, means)


def pool_accuracies(accuracies: Sequence[Accuracy]) -> Accuracy:
    """Return the accuracy of several frames of one size, each with equal weight.

    The RMSE is the root of the mean of its squares, and the PSNR follows from it. Of the largest errors the maximum is
    taken; other metrics are averaged. Frames in which a metric is NaN, such as those that show nothing of the volume,
    do not count for it; if it is NaN in all frames, so is the result. If accuracies are estimates, their samples are
    pooled.
    """
    samples = [each.samples for each in accuracies if isinstance(each, SampledAccuracy)]
    if samples:
        return sampled_accuracy(pool_samples(samples))
    return Accuracy(
        _pool_metrics([each.everywhere for each in accuracies]), _pool_metrics([each.on_volume for each in accuracies])
    )


def _pool_metrics(differences: list[ErrorMetrics]) -> ErrorMetrics:
    pools: dict[str, Callable[[Array], Any]] = {"rmse": _root_mean_square, "max_error": np.max}
    pooled = {}
    for name in METRICS:
        values = np.array([each[name] for each in differences], np.float64)
        pooled[name] = _reduce(pools.get(name, np.mean), values[~np.isnan(values)])
    return pooled | {"psnr": psnr(pooled["rmse"] ** 2)}


def _checked_means(picture: FloatImage, truth: TruePicture) -> PixelMeans:
    """Return a truth as means over pixels; a plain picture gets variances of 0. All colours must be finite."""
    means = truth if isinstance(truth, PixelMeans) else PixelMeans(truth, np.zeros_like(truth))
    _require_images(picture, means.colors)
    return means


def _require_images(*pictures: FloatImage) -> None:
    for picture in pictures:
        assert picture.shape == pictures[0].shape and picture.shape[2:] == (3,), [each.shape for each in pictures]
        require_finite(picture)
        assert picture.min() >= 0 and picture.max() <= 1, (picture.min(), picture.max())


def require_measuring_packages() -> None:
    """Raise InputError if a package that a metric needs is missing."""
    for package in ("skimage", "flip_evaluator"):
        require_package(package, extra="measure")


# Functions that make a map: the value of a metric at each pixel, from a picture and the truth.


def _squared_error_map(picture: FloatImage, means: PixelMeans) -> Array:
    """Return the estimate of the squared error of each channel, [h, w, 3], which may be below 0."""
    return np.asarray((picture - means.colors) ** 2 - means.variances)


def _error_map(picture: FloatImage, means: PixelMeans) -> Array:
    """Return the absolute difference of each channel, [h, w, 3]."""
    return np.asarray(np.abs(picture - means.colors))


def _ssim_map(picture: FloatImage, means: PixelMeans) -> Array:
    """Return the structural similarity, mean of the channels, [h, w]."""
    from skimage.metrics import structural_similarity

    truth = means.colors
    if min(picture.shape[:2]) < SSIM_WINDOW_PX:
        return np.full(picture.shape[:2], np.nan)
    total = np.zeros(picture.shape[:2])
    # Each channel is copied to contiguous memory, because filters take twice as long along strided rows.
    for channel in range(3):
        _, similarity = structural_similarity(
            np.ascontiguousarray(picture[..., channel]),
            np.ascontiguousarray(truth[..., channel]),
            gaussian_weights=True,
            sigma=_SSIM_SIGMA_PX,
            use_sample_covariance=False,
            data_range=1.0,
            full=True,
        )
        total += similarity
    return total / 3


def _flip_map(picture: FloatImage, means: PixelMeans) -> Array:
    """Return the perceived difference of FLIP, [h, w], from 0 to 1."""
    import flip_evaluator

    difference, _, _ = flip_evaluator.evaluate(
        # Copies, because FLIP needs arrays that are contiguous and writable.
        *(np.array(each, np.float32, order="C") for each in (means.colors, picture)),
        "LDR",
        inputsRGB=True,
        applyMagma=False,
        computeMeanError=False,
        parameters={"ppd": FLIP_PIXELS_PER_DEGREE},
    )
    return np.asarray(difference[..., 0], np.float64)


def _delta_e_map(picture: FloatImage, means: PixelMeans) -> Array:
    """Return the CIE 1976 colour difference, [h, w]."""
    from skimage.color import deltaE_cie76, rgb2lab

    # float32 resolves a colour difference to 1e-4, and takes half the time.
    return np.asarray(deltaE_cie76(*(rgb2lab(each.astype(np.float32)) for each in (means.colors, picture))))


# Functions that reduce the values of a map, or its values under a mask, to a number.


def _reduce(of: Callable[[Array], Any], values: Array) -> float:
    return float(of(values)) if values.size else math.nan


def _root_of_mean(values: Array) -> float:
    """Return the root of the mean of estimated squared errors; 0 if the mean is below 0."""
    return math.sqrt(max(float(np.mean(values)), 0.0))


def _root_mean_square(values: Array) -> float:
    return math.sqrt(np.mean(np.square(values)))


def _noticeable_share(values: Array) -> float:
    return float(np.mean(values > NOTICEABLE_DELTA_E))


# For each metric, the function that makes its map, and the function that reduces the map to a number.
#
# rmse: the root of the mean squared difference of the RGB channels.
# max_error: the largest difference of a channel, which includes the truth's own error.
# psnr: -20 log10(rmse); infinite for equal pictures.
# ssim: the mean structural similarity (Wang et al. 2004) of the channels; pictures are mirrored at the border. It is
#   NaN for a picture smaller than the window of 11 pixels.
# flip, flip_p99: the mean and the 99th percentile of the perceived difference (Andersson et al. 2020), 0 to 1, at
#   FLIP_PIXELS_PER_DEGREE.
# delta_e_share: the share of the pixels whose CIE 1976 colour difference is over 2.3, the just noticeable one.
_FUNCTIONS: dict[Metric, tuple[Callable[[FloatImage, PixelMeans], Array], Callable[[Array], Any]]] = {
    Metric("rmse", "RMSE"): (_squared_error_map, _root_of_mean),
    Metric("max_error", "largest error"): (_error_map, np.max),
    Metric("psnr", "PSNR", "dB", higher_is_better=True): (_squared_error_map, lambda of: psnr(_root_of_mean(of) ** 2)),
    Metric("ssim", "SSIM", higher_is_better=True): (_ssim_map, np.mean),
    Metric("flip", "FLIP"): (_flip_map, np.mean),
    Metric("flip_p99", "FLIP, 99th percentile"): (_flip_map, partial(np.percentile, q=99)),
    Metric("delta_e_share", "pixels with Delta-E over 2.3"): (_delta_e_map, _noticeable_share),
}
# All metrics, by their names.
METRICS = {metric.name: metric for metric in _FUNCTIONS}
