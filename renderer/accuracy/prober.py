"""Compare a few pixels of a frame with exact rays: these pixels are probes.

A pixel is an area: its exact colour is the mean of a few rays. The variance of this mean is estimated, and subtracted
from the squared error of the pixel.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from renderer.accuracy.estimate import ErrorSamples, error_samples
from renderer.accuracy.pixels import ChosenPixels, choose_pixels, surrounding_differences
from renderer.accuracy.shared_probes import SharedErrors, first_of_pair, shared_pixels
from renderer.accuracy.visibility import scalar_ranges, sum_ranges
from renderer.errors import InputError
from renderer.film import Pixels, behind_rows, over_black, over_rows
from renderer.frame import FilmStage, Stage, view_of
from renderer.truth import RAYS_PER_SQUARE, PixelMeans, SceneRays, means_over, places_in_pixels, sides_for
from renderer.volume import Bools, Float32, Float64, Int64, UInt8

# The step of exact rays through layers without shading, in voxels: it leaves errors of 1e-7.
_STEP = 1.0
# The step of exact rays if a layer is shaded, in voxels. It left errors of 1e-5 to 1.3e-4 (RMS over the pixels that
# were chosen in seven scans), a tenth of the error of a picture with 58 dB.
_SHADED_STEP = 0.5
# Pairs of a difference and the number of squares along a side of a pixel from this difference on; two rays pass through
# each square. The difference is the largest one of a channel among the pixel and its eight neighbours, in levels of 8
# bits. With equal numbers of rays, estimates for antialiased frames of eight scans had 9 times the deviation with one
# square in every pixel, 1.8 times with 2 x 2, and 1.3 times with 4 x 4.
_SIDES = ((0, 1), (8, 2), (51, 4))
# If the scene does not give a number of probes, a picture has a probe for this many pixels.
_PIXELS_PER_PROBE = 16384
# If the scene does not give a number of probes, a frame has at least this many.
_MIN_PROBES = 16
# If the scene does not give a number of probes, all frames of the path have at least this many together.
_MIN_PROBES_OF_PATH = 512


@dataclass(frozen=True)
class Probe:
    """The result of the probes of a frame.

    samples: a summary of the squared errors of probes.
    largest_error: the largest error of a channel at a probe, in [0, 1]; at edges it is too large, as rays are few.
    visible: the opacity that each of the `scalar_ranges` adds to the mean opacity of the picture; empty in modes that
        show a number of a ray in place of light.
    shared: the errors at probes that the frame shares with a neighbouring frame; None if it shares none.
    """

    samples: ErrorSamples
    largest_error: float
    visible: tuple[float, ...] = ()
    shared: SharedErrors | None = None


@dataclass(frozen=True)
class ExactPixels:
    """The exact colours of some pixels of a frame, over the background.

    chosen: the pixels. means: the means of their rays. behind: float64 [n, 3], the background behind each pixel.
    visible: as in Probe; empty if the rays were integrated until they converged.
    """

    chosen: ChosenPixels
    means: PixelMeans
    behind: Float64
    visible: tuple[float, ...] = ()

    def compare_image(self, image: Pixels, covered: Bools | None = None) -> Probe:
        """Measure the error of a picture of any bit depth; a transparent picture is compared over black.

        covered: bool [h, w], pixels over which an annotation is drawn: the error is that of all other pixels.
        """
        colors = over_black(image.reshape(-1, image.shape[2])[self.chosen.numbers])[:, :3]
        if covered is None:
            return self._compare(colors)
        is_open = ~covered.reshape(-1)[self.chosen.numbers]
        return self._compare(colors, is_open / max(1 - covered.mean(), 1 / covered.size))

    def compare_radiance(self, radiance: Float32) -> Probe:
        """Measure the error of a picture before it is rounded. radiance: [h, w, 4], premultiplied RGBA."""
        return self._compare(over_rows(radiance.reshape(-1, 1, 4)[self.chosen.numbers], self.behind)[:, 0])

    def compare_picture(self, picture: npt.NDArray[np.floating]) -> Probe:
        """Measure the error of a picture. picture: [h, w, 3], in [0, 1], already over its background."""
        return self._compare(picture.reshape(-1, 3)[self.chosen.numbers])

    def _compare(self, colors: npt.NDArray[np.floating], weights: Float64 | float = 1.0) -> Probe:
        errors = (colors - self.means.colors) ** 2 - self.means.variances
        errors *= np.reshape(weights, (-1, 1))
        samples = error_samples(self.chosen.factors * errors.mean(axis=1))
        return Probe(samples, float(np.sqrt(max(errors.max(), 0.0))), self.visible)


class FrameProber:
    """An object that chooses probes in frames and computes their exact colours.

    stage: the stage of a film in which only the camera moves, or of one frame.
    num_probes: the number of probes of a frame.
    seed: of the choice of pixels, which also depends on the frame's number.
    tolerance: the largest change of a channel at which exact rays count as converged; None to integrate rays once, with
        a fixed step.
    """

    def __init__(
        self, stage: Stage, num_probes: int, *, seed: int = 0, num_threads: int = 2, tolerance: float | None = None
    ) -> None:
        require_exact_rays(stage)
        self._tolerance, self._num_threads = tolerance, num_threads
        self._stage, self._num_probes, self._seed = stage, num_probes, seed
        self._rays = SceneRays(stage, num_threads=num_threads)
        is_lit = any(layer.spec.shading is not None for layer in stage.layers)
        self._step = _SHADED_STEP if is_lit else _STEP
        self._ranges = scalar_ranges(stage)

    def on(self, stage: Stage) -> FrameProber:
        """Return a prober for the stage of another frame. If the layers are the same, the prepared rays are reused."""
        if stage.groups is self._stage.groups:
            prober = copy(self)
            prober._stage = stage
            return prober
        options = {"seed": self._seed, "num_threads": self._num_threads}
        return FrameProber(stage, self._num_probes, tolerance=self._tolerance, **options)

    def exact_pixels(self, number: int, image: Pixels) -> ExactPixels:
        """Choose pixels of a frame by its picture, [h, w, channels], and compute their exact colours."""
        coarse = _coarse(image)
        chosen = choose_pixels(coarse, self._num_probes, (self._seed, number))
        behind, sides, places = self._places(number, coarse, chosen.numbers)
        view, visible, num_rays = view_of(self._stage, number), tuple[float, ...](), RAYS_PER_SQUARE * sides**2
        if self._tolerance is None:
            exact, by_interval = self._rays.integrate_by_interval(view, places, self._step)
            shares = np.repeat(chosen.factors / self._num_probes / num_rays, num_rays)
            visible = sum_ranges(np.einsum("i,ij->j", shares, by_interval), self._ranges)
        else:
            exact, _ = self._rays.converge(view, places, self._tolerance)
        return ExactPixels(chosen, means_over(exact, behind, sides), behind, visible)

    def _places(self, number: int, coarse: UInt8, pixels: Int64) -> tuple[Float64, Int64, Float64]:
        """Return the background behind pixels of a frame, the squares along each side, and the places of their rays."""
        width = coarse.shape[1]
        behind = behind_rows(self._stage.scene.background, len(coarse))[pixels // width]
        sides = sides_for(surrounding_differences(coarse, pixels), _SIDES)
        places = places_in_pixels(pixels, width, sides, RAYS_PER_SQUARE, (self._seed, number))
        return behind, sides, places.reshape(-1, 2)

    def probe(self, number: int, image: Pixels, covered: Bools | None = None) -> Probe:
        """Measure the error of a frame's picture; parameters as in `exact_pixels` and `compare_image`."""
        seen = image if covered is None else np.where(covered[..., None], image.dtype.type(0), image)
        probe = self.exact_pixels(number, seen).compare_image(image, covered)  # chosen without the annotation's edges
        return replace(probe, shared=self._shared_errors(number, image, covered))

    def _shared_errors(self, number: int, image: Pixels, covered: Bools | None) -> SharedErrors | None:
        """Return the errors of a frame's picture at the probes that it shares with a neighbouring frame; None without.

        There are as many shared probes as other probes. They are not chosen by edges, so that few need many rays: they
        take 0.4 of the time of the other probes.
        """
        first = first_of_pair(number, self._stage.scene.camera.num_frames)
        if first is None:
            return None
        height, width, num_channels = image.shape
        _, pixels, channels = shared_pixels(first, height * width, self._num_probes, self._seed)
        behind, sides, places = self._places(number, _coarse(image), pixels)
        exact = self._rays.integrate(view_of(self._stage, number), places, self._step)
        means, at = means_over(exact, behind, sides), (np.arange(pixels.size), channels)
        errors = over_black(image.reshape(-1, num_channels)[pixels])[at] - means.colors[at]
        if covered is not None:
            errors = np.where(covered.reshape(-1)[pixels], np.nan, errors)
        return SharedErrors(first, tuple(errors.tolist()))


def require_exact_rays(film: FilmStage) -> None:
    """Raise InputError for a film whose accuracy exact rays cannot measure, because its matter scatters light."""
    if film.scene.at(0).light is not None:
        raise InputError(
            "the accuracy of scattered light cannot be measured yet",
            got="a scene with light",
            expected="a scene without light, or with shading",
        )


def _coarse(image: Pixels) -> UInt8:
    """Return a picture of any depth, over black, in 8 bits."""
    is_coarse = image.dtype == np.uint8 and image.shape[2] == 3
    return image if is_coarse else np.rint(over_black(image)[..., :3] * 255).astype(np.uint8)


def open_prober(film: FilmStage, num_threads: int) -> FrameProber | None:
    """Return a prober with the number of probes that a scene asks for, or a default; None if it asks for 0 probes.

    None also for a scene with `light`: exact rays do not follow light that matter scatters.
    """
    scene, num_probes = film.scene, film.scene.error.probes
    if scene.at(0).light is not None:
        return None
    if num_probes is None:
        width, height = scene.output.size
        num_probes = max(_MIN_PROBES, width * height // _PIXELS_PER_PROBE, _MIN_PROBES_OF_PATH // scene.num_frames)
    return FrameProber(film.first, num_probes, num_threads=num_threads) if num_probes else None
