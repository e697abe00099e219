"""Compare a few pixels of a frame with exact rays: probes.

A pixel is an area: its exact colour is the mean of a few rays, whose variance is known and taken away.
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
from renderer.film import Pixels, behind_rows, over_black, over_rows
from renderer.frame import FilmStage, Stage, view_of
from renderer.truth import RAYS_PER_SQUARE, PixelMeans, SceneRays, means_over, places_in_pixels, sides_for
from renderer.volume import Bools, Float32, Float64, Int64, UInt8

# Of the rays, in voxels. Without shading 1 leaves errors of 1e-7. With it, 1/2 left 1e-5 to 1.3e-4 (RMS over the pixels
# that were chosen in seven scans), a tenth of the error of a picture with 58 dB.
_STEP, _SHADED_STEP = 1.0, 0.5
# Squares along a side of a pixel, by the largest difference of a channel among the pixel and its eight neighbours, in
# levels of 8 bits. From as many rays, estimates of antialiased frames of eight scans had 9 times the deviation with one
# square everywhere, 1.8 times with 2 x 2, 1.3 times with 4 x 4.
_SIDES = ((0, 1), (8, 2), (51, 4))
# Where the scene does not say: pixels of a picture for each probe, the fewest probes of a frame, and of a whole path.
_PIXELS_PER_PROBE, _MIN_PROBES, _MIN_PROBES_OF_PATH = 16384, 16, 512


@dataclass(frozen=True)
class Probe:
    """A record of the probes of a frame.

    largest_error: the largest error that a probe tells of a channel, in [0, 1]; at edges its few rays tell too much.
    visible: what each of the `scalar_ranges` adds to the mean opacity of the picture; empty of projections.
    shared: the errors at the probes that a frame beside this one has, too; None if there are none.
    """

    samples: ErrorSamples
    largest_error: float
    visible: tuple[float, ...] = ()
    shared: SharedErrors | None = None


@dataclass(frozen=True)
class ExactPixels:
    """A set of exact means of some pixels of a frame, over what is behind them.

    behind: float64 [n, 3]. visible: as in Probe; empty of rays that converge.
    """

    chosen: ChosenPixels
    means: PixelMeans
    behind: Float64
    visible: tuple[float, ...] = ()

    def compare_image(self, image: Pixels, covered: Bools | None = None) -> Probe:
        """Measure the error of a picture of any depth; a transparent one is compared over black.

        covered: pixels over which something is drawn, [h, w]; the error is that of the others.
        """
        colors = over_black(image.reshape(-1, image.shape[2])[self.chosen.numbers])[:, :3]
        if covered is None:
            return self._compare(colors)
        is_open = ~covered.reshape(-1)[self.chosen.numbers]
        return self._compare(colors, is_open / max(1 - covered.mean(), 1 / covered.size))

    def compare_radiance(self, radiance: Float32) -> Probe:
        """Measure the error of a picture before it is rounded: premultiplied RGBA, [h, w, 4]."""
        return self._compare(over_rows(radiance.reshape(-1, 1, 4)[self.chosen.numbers], self.behind)[:, 0])

    def compare_picture(self, picture: npt.NDArray[np.floating]) -> Probe:
        """Measure the error of a picture over its background, in [0, 1]: [h, w, 3]."""
        return self._compare(picture.reshape(-1, 3)[self.chosen.numbers])

    def _compare(self, colors: npt.NDArray[np.floating], weights: Float64 | float = 1.0) -> Probe:
        errors = (colors - self.means.colors) ** 2 - self.means.variances
        errors *= np.reshape(weights, (-1, 1))
        samples = error_samples(self.chosen.factors * errors.mean(axis=1))
        return Probe(samples, float(np.sqrt(max(errors.max(), 0.0))), self.visible)


class FrameProber:
    """A prober of frames by a stage, of a film in which nothing moves, or of one frame.

    seed: of the choice of pixels, which also depends on the frame's number.
    tolerance: of the convergence of the exact rays, in every channel; None for rays of one step.
    """

    def __init__(
        self, stage: Stage, num_probes: int, *, seed: int = 0, num_threads: int = 2, tolerance: float | None = None
    ) -> None:
        self._tolerance, self._num_threads = tolerance, num_threads
        self._stage, self._num_probes, self._seed = stage, num_probes, seed
        self._rays = SceneRays(stage, num_threads=num_threads)
        is_lit = any(layer.spec.shading is not None for layer in stage.layers)
        self._step = _SHADED_STEP if is_lit else _STEP
        self._ranges = scalar_ranges(stage)

    def on(self, stage: Stage) -> FrameProber:
        """Return a prober of the stage of another frame, with the same rays where its layers are the same."""
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
        """Return what is behind pixels of a frame, the squares along their sides, and the places of their rays."""
        width = coarse.shape[1]
        behind = behind_rows(self._stage.scene.background, len(coarse))[pixels // width]
        sides = sides_for(surrounding_differences(coarse, pixels), _SIDES)
        places = places_in_pixels(pixels, width, sides, RAYS_PER_SQUARE, (self._seed, number))
        return behind, sides, places.reshape(-1, 2)

    def probe(self, number: int, image: Pixels, covered: Bools | None = None) -> Probe:
        """Measure the error of a frame's picture; parameters as in `exact_pixels` and `compare_image`."""
        seen = image if covered is None else np.where(covered[..., None], image.dtype.type(0), image)
        probe = self.exact_pixels(number, seen).compare_image(image, covered)  # edges of what covers are not looked at
        return replace(probe, shared=self._shared_errors(number, image, covered))

    def _shared_errors(self, number: int, image: Pixels, covered: Bools | None) -> SharedErrors | None:
        """Return the errors of a frame's picture at the probes that it shares with a frame beside it.

        They are as many as its other probes. Few have edges, and so many rays: they take 0.4 of the time of the others.
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


def _coarse(image: Pixels) -> UInt8:
    """Return a picture of any depth, over black, in 8 bits."""
    is_coarse = image.dtype == np.uint8 and image.shape[2] == 3
    return image if is_coarse else np.rint(over_black(image)[..., :3] * 255).astype(np.uint8)


def open_prober(film: FilmStage, num_threads: int) -> FrameProber | None:
    """Return a prober with the probes that a scene wants; None where it wants none."""
    scene, num_probes = film.scene, film.scene.error.probes
    if num_probes is None:
        width, height = scene.output.size
        num_probes = max(_MIN_PROBES, width * height // _PIXELS_PER_PROBE, _MIN_PROBES_OF_PATH // scene.num_frames)
    return FrameProber(film.first, num_probes, num_threads=num_threads) if num_probes else None
