"""Compare a few pixels of a frame with the exact ray integral."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass

import numpy as np

from renderer.accuracy.estimate import ErrorSamples, error_samples
from renderer.accuracy.pixels import ChosenPixels, choose_pixels
from renderer.accuracy.visibility import scalar_ranges, sum_ranges
from renderer.film import Pixels, behind_rows, over_black, over_rows
from renderer.frame import FilmStage, Stage, view_of
from renderer.truth import SceneRays
from renderer.volume import Bools, Float32, Float64

# Of the rays, in voxels. Without shading 1 leaves errors of 1e-7. With it, 1/2 left 1e-5 to 1.3e-4 (RMS over the pixels
# that were chosen in seven scans), a tenth of the error of a picture with 58 dB.
_STEP, _SHADED_STEP = 1.0, 0.5
# Where the scene does not say: pixels of a picture for each ray, and the fewest rays of a frame and of a whole path. At
# 512 x 512, 32 rays a frame took 1 to 8 % of the time of films of eight scans, 4 % in the median.
_PIXELS_PER_RAY, _MIN_RAYS, _MIN_RAYS_OF_PATH = 8192, 32, 1024


@dataclass(frozen=True)
class Probe:
    """A probe of a frame by exact rays. largest_error: the largest error seen of a channel, in [0, 1].

    visible: what each of the `scalar_ranges` adds to the mean opacity of the picture; empty of projections.
    """

    samples: ErrorSamples
    largest_error: float
    visible: tuple[float, ...] = ()


@dataclass(frozen=True)
class ExactPixels:
    """A set of exact colours of some pixels of a frame, over what is behind them: float64 [n, 3] in [0, 1].

    visible: as in Probe; empty of rays that converge.
    """

    chosen: ChosenPixels
    colors: Float64
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

    def compare_picture(self, picture: Float64) -> Probe:
        """Measure the error of a picture against the exact pixels.

        picture: [h, w, 3], colours in [0, 1], over their background.
        """
        return self._compare(picture.reshape(-1, 3)[self.chosen.numbers])

    def _compare(self, colors: Float64, weights: Float64 | float = 1.0) -> Probe:
        errors = (colors - self.colors) ** 2 * np.reshape(weights, (-1, 1))
        samples = error_samples(self.chosen.factors * errors.mean(axis=1))
        return Probe(samples, float(np.sqrt(errors.max())), self.visible)


class FrameProber:
    """A prober of frames by a stage, of a film in which nothing moves, or of one frame.

    seed: of the choice of pixels, which also depends on the frame's number.
    tolerance: of the convergence of the exact rays, in every channel; None for rays of one step.
    """

    def __init__(
        self, stage: Stage, num_rays: int, *, seed: int = 0, num_threads: int = 2, tolerance: float | None = None
    ) -> None:
        self._tolerance, self._num_threads = tolerance, num_threads
        self._stage, self._num_rays, self._seed = stage, num_rays, seed
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
        return FrameProber(stage, self._num_rays, tolerance=self._tolerance, **options)

    def exact_pixels(self, number: int, image: Pixels) -> ExactPixels:
        """Choose pixels of a frame by its picture, [h, w, channels], and compute their exact colours."""
        coarse = image if image.dtype == np.uint8 else (over_black(image) * 255).astype(np.uint8)
        chosen = choose_pixels(coarse, self._num_rays, (self._seed, number))
        behind = behind_rows(self._stage.scene.background, len(image))[chosen.numbers // image.shape[1]]
        view = view_of(self._stage, number)
        visible: tuple[float, ...] = ()
        if self._tolerance is None:
            exact, by_interval = self._rays.integrate_by_interval(view, chosen.numbers, self._step)
            visible = sum_ranges(np.einsum("i,ij->j", chosen.factors, by_interval) / self._num_rays, self._ranges)
        else:
            exact, _ = self._rays.converge(view, chosen.numbers, self._tolerance)
        return ExactPixels(chosen, over_rows(exact[:, None], behind)[:, 0], behind, visible)

    def probe(self, number: int, image: Pixels, covered: Bools | None = None) -> Probe:
        """Measure the error of a frame's picture; parameters as in `exact_pixels` and `compare_image`."""
        return self.exact_pixels(number, image).compare_image(image, covered)


def open_prober(film: FilmStage, num_threads: int) -> FrameProber | None:
    """Return a prober with the rays that a scene wants; None where it wants none."""
    scene, num_rays = film.scene, film.scene.error.probes
    if num_rays is None:
        width, height = scene.output.size
        num_rays = max(_MIN_RAYS, width * height // _PIXELS_PER_RAY, _MIN_RAYS_OF_PATH // scene.num_frames)
    return FrameProber(film.first, num_rays, num_threads=num_threads) if num_rays else None
