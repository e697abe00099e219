"""Compare a few pixels of a frame with their exact colours, by rays or paths: these pixels are probes."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from renderer.accuracy.estimate import ErrorSamples, error_samples
from renderer.accuracy.pixel_truths import SeenPixels, open_truth
from renderer.accuracy.pixels import ChosenPixels, choose_pixels, surrounding_differences
from renderer.accuracy.shared_probes import SharedErrors, first_of_pair, shared_pixels
from renderer.film import Pixels, behind_rows, over_black, over_rows
from renderer.frame import FilmStage, Stage, view_of
from renderer.truth import PixelMeans
from renderer.volume import Bools, Float32, Float64, Int64, UInt8

# If the scene does not give a number of probes, a picture has a probe for this many pixels.
_PIXELS_PER_PROBE = 16384
# If the scene does not give a number of probes, a frame has at least this many.
_MIN_PROBES = 16
# If the scene does not give a number of probes, probes by paths are fewer by this factor, because each takes longer. In
# films of 120 frames of 512 x 512 pixels, of an engine and a bonsai, drawing took 0.10 and 0.13 s of processor time a
# frame, and 16 probes, with as many shared ones, 0.03 s.
_FEWER_BY_PATHS = 2
# If the scene does not give a number of probes, all frames of the path have at least this many together.
_MIN_PROBES_OF_PATH = 512


@dataclass(frozen=True)
class Probe:
    """The result of the probes of a frame.

    samples: a summary of the squared errors of probes.
    largest_error: the largest error of a channel at a probe, in [0, 1]; too large at edges, and by paths, as rays and
        paths are few.
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

    chosen: the pixels. means: their exact colours. behind: float64 [n, 3], the background behind each pixel.
    visible: as in Probe; empty if the rays were integrated until they converged.
    is_linear: whether radiance and background are linear light, and pictures are encoded as sRGB.
    """

    chosen: ChosenPixels
    means: PixelMeans
    behind: Float64
    visible: tuple[float, ...] = ()
    is_linear: bool = False

    def compare_image(self, image: Pixels, covered: Bools | None = None) -> Probe:
        """Measure the error of a picture of any bit depth; a transparent picture is compared over black.

        covered: bool [h, w], pixels over which an annotation is drawn: the error is that of all other pixels.
        """
        return self._compare(self._colors(image), self._weights(covered))

    def error_products(self, image: Pixels, changed: Pixels, covered: Bools | None = None) -> ErrorSamples:
        """Return samples of twice the product of a picture's error and of the difference of a changed picture from it.

        The squared error of the changed picture is that of the picture, the squared difference, and this product.
        covered: as in `compare_image`.
        """
        drawn = self._colors(image)
        products = 2 * (self._colors(changed) - drawn) * (drawn - self.means.colors)
        return error_samples(self.chosen.factors * self._weights(covered) * products.mean(axis=1))

    def compare_radiance(self, radiance: Float32) -> Probe:
        """Measure the error of a picture before it is rounded. radiance: [h, w, 4], premultiplied RGBA."""
        pixels = radiance.reshape(-1, 1, 4)[self.chosen.numbers]
        return self._compare(over_rows(pixels, self.behind, is_linear=self.is_linear)[:, 0])

    def compare_picture(self, picture: npt.NDArray[np.floating]) -> Probe:
        """Measure the error of a picture. picture: [h, w, 3], in [0, 1], already over its background."""
        return self._compare(picture.reshape(-1, 3)[self.chosen.numbers])

    def _colors(self, image: Pixels) -> Float64:
        pixels = image.reshape(-1, image.shape[2])[self.chosen.numbers]
        return over_black(pixels, is_linear=self.is_linear)[:, :3]

    def _weights(self, covered: Bools | None) -> Float64 | float:
        """Return weights by which means over the chosen pixels are those of all pixels that are not covered."""
        if covered is None:
            return 1.0
        is_open = ~covered.reshape(-1)[self.chosen.numbers]
        weights: Float64 = is_open / max(1 - covered.mean(), 1 / covered.size)
        return weights

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
    tolerance: as of `open_truth`.
    """

    def __init__(
        self, stage: Stage, num_probes: int, *, seed: int = 0, num_threads: int = 2, tolerance: float | None = None
    ) -> None:
        self._tolerance, self._num_threads = tolerance, num_threads
        self._stage, self._num_probes, self._seed = stage, num_probes, seed
        self._is_linear = stage.scene.light is not None
        self._truth = open_truth(stage, tolerance, num_threads)

    def on(self, stage: Stage) -> FrameProber:
        """Return a prober for the stage of another frame. If the layers are the same, the prepared truth is reused."""
        if stage.groups is self._stage.groups:
            prober = copy(self)
            prober._stage = stage
            return prober
        options = {"seed": self._seed, "num_threads": self._num_threads}
        return FrameProber(stage, self._num_probes, tolerance=self._tolerance, **options)

    def exact_pixels(self, number: int, image: Pixels) -> ExactPixels:
        """Choose pixels of a frame by its picture, [h, w, channels], and compute their exact colours."""
        coarse, view, seed = self._coarse(image), view_of(self._stage, number), (self._seed, number)
        chosen = choose_pixels(coarse, self._num_probes, seed)
        pixels, shares = self._seen(coarse, chosen.numbers), chosen.factors / self._num_probes
        means, visible = self._truth.visible(view, pixels, shares, seed)
        return ExactPixels(chosen, means, pixels.behind, visible, self._is_linear)

    def _seen(self, coarse: UInt8, numbers: Int64) -> SeenPixels:
        """Return pixels of a frame with their surroundings. coarse: the picture of the frame in 8 bits."""
        rows = behind_rows(self._stage.scene.background, len(coarse), is_linear=self._is_linear)
        return SeenPixels(numbers, surrounding_differences(coarse, numbers), rows[numbers // coarse.shape[1]])

    def _coarse(self, image: Pixels) -> UInt8:
        """Return a picture of any depth, over black, in 8 bits."""
        is_coarse = image.dtype == np.uint8 and image.shape[2] == 3
        if is_coarse:
            return image
        return np.rint(over_black(image, is_linear=self._is_linear)[..., :3] * 255).astype(np.uint8)

    def probe(self, number: int, image: Pixels, covered: Bools | None = None) -> Probe:
        """Measure the error of a frame's picture; parameters as in `exact_pixels` and `compare_image`."""
        probe = self.exact_pixels(number, _without(image, covered)).compare_image(image, covered)
        return replace(probe, shared=self._shared_errors(number, image, covered))

    def error_products(self, number: int, image: Pixels, changed: Pixels, covered: Bools | None) -> ErrorSamples:
        """Return samples as `ExactPixels.error_products` does, at pixels that are chosen by the frame's picture."""
        return self.exact_pixels(number, _without(image, covered)).error_products(image, changed, covered)

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
        seen, seed = self._seen(self._coarse(image), pixels), (self._seed, number)
        means = self._truth.means(view_of(self._stage, number), seen, seed)
        shown, at = (
            over_black(image.reshape(-1, num_channels)[pixels], is_linear=self._is_linear),
            np.arange(pixels.size),
        )
        errors = shown[at, channels] - means.colors[at, channels]
        if covered is not None:
            errors = np.where(covered.reshape(-1)[pixels], np.nan, errors)
        return SharedErrors(first, tuple(errors.tolist()))


def _without(image: Pixels, covered: Bools | None) -> Pixels:
    """Return a picture without its annotation, by whose edges no pixels are to be chosen."""
    return image if covered is None else np.where(covered[..., None], image.dtype.type(0), image)


def open_prober(film: FilmStage, num_threads: int) -> FrameProber | None:
    """Return a prober with the number of probes that a scene asks for, or a default; None if it asks for 0 probes."""
    scene, num_probes = film.scene, film.scene.error.probes
    if num_probes is None:
        width, height = scene.output.size
        num_of_frame = max(_MIN_PROBES, width * height // _PIXELS_PER_PROBE)
        if scene.at(0).light is not None:
            num_of_frame //= _FEWER_BY_PATHS
        num_probes = max(num_of_frame, _MIN_PROBES_OF_PATH // scene.num_frames)
    return FrameProber(film.first, num_probes, num_threads=num_threads) if num_probes else None
