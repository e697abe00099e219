"""How far a picture is from the truth, by the metrics of the field.

Pictures are compared as they are seen: over the scene's background, clipped to [0, 1], before quantisation. They are
display-referred, so that the metrics of perception take them as sRGB. The packages that compute those (the extra
`measure`) are imported when they are used.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.errors import require_package
from renderer.film import require_finite
from renderer.scene import Color

FloatImage = npt.NDArray[np.float64]
Mask = npt.NDArray[np.bool_]
_Map = npt.NDArray[Any]

# FLIP's own default: a display 0.7 m wide with 3840 pixels, seen from 0.7 m.
FLIP_PIXELS_PER_DEGREE = 0.7 * 3840 / 0.7 * math.pi / 180
# The just noticeable colour difference in CIE 1976 L*a*b* (Mahy, Van Eycken, Oosterlinck 1994).
NOTICEABLE_DELTA_E = 2.3
# Of Wang et al. 2004; the window is what scikit-image makes of it, 3.5 deviations to each side.
_SSIM_SIGMA_PX = 1.5
SSIM_WINDOW_PX = 11
# How many rows or columns off a pixel still changes what SSIM or FLIP says of another: the widest of their filters is
# FLIP's for blue and yellow, which ends after 3 deviations of sqrt(0.04 / (2 pi^2)) degrees.
REACH_PX = 10


@dataclass(frozen=True)
class Metric:
    """A number that a comparison of two images comes to.

    name: in options, files and reports. label: in words. unit: "dB", "levels" or "".
    higher_is_better: its limit is the least value that passes, not the most.
    """

    name: str
    label: str
    unit: str = ""
    higher_is_better: bool = False

    def passes(self, value: float, limit: float) -> bool:
        """Return whether a value is within a limit."""
        return value >= limit if self.higher_is_better else value <= limit


METRICS = (
    Metric("rmse", "RMSE"),
    Metric("max_error", "largest error"),
    Metric("psnr", "PSNR", "dB", higher_is_better=True),
    Metric("ssim", "SSIM", higher_is_better=True),
    Metric("flip", "FLIP"),
    Metric("flip_p99", "FLIP, 99th percentile"),
    Metric("delta_e_share", "pixels with Delta-E over 2.3"),
)


@dataclass(frozen=True)
class ErrorMetrics:
    """A picture against the truth, over some pixels; NaN for what is not defined there (SSIM of a tiny picture).

    rmse: root of the mean squared difference of the RGB channels. max_error: largest difference of a channel.
    psnr: `-20 log10 rmse`, dB; infinite for equal pictures.
    ssim: mean structural similarity (Wang et al. 2004) of the channels, over all pixels: at the border the pictures are
        mirrored. NaN for a picture smaller than the window of 11 pixels.
    flip, flip_p99: mean and 99th percentile of the perceived difference (Andersson et al. 2020), 0 to 1, at
        FLIP_PIXELS_PER_DEGREE.
    delta_e_share: share of the pixels whose CIE 1976 colour difference is over 2.3, the just noticeable one.
    """

    rmse: float
    max_error: float
    psnr: float
    ssim: float
    flip: float
    flip_p99: float
    delta_e_share: float


@dataclass(frozen=True)
class Accuracy:
    """A picture against the truth: over all pixels, and over those in which the truth has anything of the volume."""

    everywhere: ErrorMetrics
    on_volume: ErrorMetrics


def over_background(radiance: npt.NDArray[np.floating[Any]], background: Color | None) -> FloatImage:
    """The picture that is compared: `c + (1 - a) b`, clipped to [0, 1].

    radiance: [h, w, 4], premultiplied RGBA. background: None, for a transparent film, counts as black.

    Returns float64 [h, w, 3]. A value that is not finite raises RenderError.
    """
    require_finite(radiance)
    picture = np.empty((*radiance.shape[:2], 3))
    transparency = 1 - radiance[..., 3].astype(np.float64)
    for channel, behind in enumerate(background or (0.0, 0.0, 0.0)):
        picture[..., channel] = radiance[..., channel] + transparency * behind
    return np.clip(picture, 0, 1, out=picture)


def measure_accuracy(picture: FloatImage, truth: FloatImage, on_volume: Mask) -> Accuracy:
    """All metrics, over all pixels and over those of a mask.

    picture, truth: float [h, w, 3] in [0, 1], sRGB where a metric models the eye. on_volume: bool [h, w]; where it is
        empty its figures are NaN. SSIM and FLIP look at surroundings, which may reach beyond the mask.

    Needs the packages that `require_measuring_packages` asks for. Raises RenderError for a value that is not finite, of
    which FLIP would make a perfect 0.
    """
    _require_images(picture, truth)
    assert on_volume.shape == picture.shape[:2], (on_volume.shape, picture.shape)
    maps = {make_map: make_map(picture, truth) for make_map in dict.fromkeys(make for make, _ in _FIGURES.values())}

    def difference(pixels: Any) -> ErrorMetrics:
        return ErrorMetrics(**{name: _figure(of, maps[make_map][pixels]) for name, (make_map, of) in _FIGURES.items()})

    return Accuracy(difference(np.ones_like(on_volume)), difference(on_volume))


def compute_metric(name: str, picture: FloatImage, truth: FloatImage) -> float:
    """One metric of METRICS over all pixels, at its own price; parameters and errors are those of `compare`."""
    _require_images(picture, truth)
    make_map, of = _FIGURES[name]
    return _figure(of, make_map(picture, truth))


def metric_map(name: str, picture: FloatImage, truth: FloatImage) -> FloatImage:
    """What a metric of METRICS takes the mean of, for each pixel, float64 [h, w]: of `ssim` or `flip`.

    It depends on what is at most REACH_PX away, in rows and in columns. Parameters and errors are those of `compare`.
    """
    _require_images(picture, truth)
    make_map, of = _FIGURES[name]
    assert of is np.mean, name
    return make_map(picture, truth)


def pool_accuracies(accuracies: Sequence[Accuracy]) -> Accuracy:
    """The accuracy of several frames of one size: RMSE from the mean of the squares, PSNR from that, the largest error
    of all, and the means of the others. Every frame counts alike, however many of its pixels show the volume.

    Frames without a figure (NaN) are left out of it, as one that shows nothing of the volume has no pixel on it to add;
    it is NaN where no frame has one.
    """
    return Accuracy(
        _pool_metrics([each.everywhere for each in accuracies]), _pool_metrics([each.on_volume for each in accuracies])
    )


def _pool_metrics(differences: list[ErrorMetrics]) -> ErrorMetrics:
    def figures(name: str) -> npt.NDArray[np.float64]:
        values = np.array([getattr(each, name) for each in differences], np.float64)
        return values[~np.isnan(values)]

    rmse = _figure(_root_mean_square, figures("rmse"))
    result = {field.name: _figure(np.mean, figures(field.name)) for field in fields(ErrorMetrics)}
    return ErrorMetrics(
        **{**result, "rmse": rmse, "psnr": _psnr_of(rmse), "max_error": _figure(np.max, figures("max_error"))}
    )


def _require_images(*pictures: FloatImage) -> None:
    for picture in pictures:
        assert picture.shape == pictures[0].shape and picture.shape[2:] == (3,), [each.shape for each in pictures]
        require_finite(picture)
        assert picture.min() >= 0 and picture.max() <= 1, (picture.min(), picture.max())


def require_measuring_packages() -> None:
    """Raise InputError if a package is missing without which not all metrics can be taken."""
    for package in ("skimage", "flip_evaluator"):
        require_package(package, extra="measure")


# Maps: what a metric says of each pixel, from a picture and the truth.


def _error_map(picture: FloatImage, truth: FloatImage) -> _Map:
    """[h, w, 3]: the difference of each channel, without its sign."""
    return np.abs(picture - truth)


def _ssim_map(picture: FloatImage, truth: FloatImage) -> _Map:
    """[h, w]: structural similarity, mean of the channels."""
    from skimage.metrics import structural_similarity

    if min(picture.shape[:2]) < SSIM_WINDOW_PX:
        return np.full(picture.shape[:2], np.nan)
    total = np.zeros(picture.shape[:2])
    # Channel by channel in one piece: the filters take twice as long along strided rows.
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


def _flip_map(picture: FloatImage, truth: FloatImage) -> _Map:
    """[h, w]: the perceived difference."""
    import flip_evaluator

    difference, _, _ = flip_evaluator.evaluate(
        _for_flip(truth),
        _for_flip(picture),
        "LDR",
        inputsRGB=True,
        applyMagma=False,
        computeMeanError=False,
        parameters={"ppd": FLIP_PIXELS_PER_DEGREE},
    )
    return np.asarray(difference[..., 0], np.float64)


def _for_flip(picture: FloatImage) -> npt.NDArray[np.float32]:
    """A copy of the only kind that flip_evaluator takes without a complaint: float32, in one piece, writable."""
    return np.array(picture, np.float32, order="C")


def _delta_e_map(picture: FloatImage, truth: FloatImage) -> _Map:
    """[h, w]: CIE 1976 colour difference."""
    from skimage.color import deltaE_cie76, rgb2lab

    # float32 resolves a colour difference to 1e-4, and takes half the time.
    return np.asarray(deltaE_cie76(*(rgb2lab(each.astype(np.float32)) for each in (truth, picture))))


# Figures: what remains of a map, or of the part of it under a mask.


def _figure(of: Callable[[_Map], Any], values: _Map) -> float:
    return float(of(values)) if values.size else math.nan


def _root_mean_square(values: _Map) -> float:
    return math.sqrt(np.mean(np.square(values)))


def _psnr(values: _Map) -> float:
    return _psnr_of(_root_mean_square(values))


def _psnr_of(rmse: float) -> float:
    return -20 * math.log10(rmse) if rmse != 0 else math.inf


def _99th_percentile(values: _Map) -> float:
    return float(np.percentile(values, 99))


def _noticeable_share(values: _Map) -> float:
    return float(np.mean(values > NOTICEABLE_DELTA_E))


# The map and the figure that make a field of Difference.
_FIGURES: dict[str, tuple[Callable[[FloatImage, FloatImage], _Map], Callable[[_Map], Any]]] = {
    "rmse": (_error_map, _root_mean_square),
    "max_error": (_error_map, np.max),
    "psnr": (_error_map, _psnr),
    "ssim": (_ssim_map, np.mean),
    "flip": (_flip_map, np.mean),
    "flip_p99": (_flip_map, _99th_percentile),
    "delta_e_share": (_delta_e_map, _noticeable_share),
}
