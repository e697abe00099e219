"""Compare a few pixels of a frame with the exact ray integral."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.film import Pixels, over_background
from renderer.frame import Stage, view_of
from renderer.probes.estimate import ErrorSamples, error_samples
from renderer.probes.pixels import choose_pixels
from renderer.scene import Scene
from renderer.transfer import make_transfer_function
from renderer.truth import RayIntegrator
from renderer.volume import Float32, Float64

# Of the rays, in voxels. Without shading 1 leaves errors of 1e-7. With it, 1/2 left 1e-5 to 1.3e-4 (RMS over the pixels
# that were chosen in seven scans), a tenth of the error of a picture with 58 dB.
_STEP, _SHADED_STEP = 1.0, 0.5
# Where the scene does not say: pixels of a picture for each ray, and the fewest rays of a frame and of a whole path.
_PIXELS_PER_RAY, _MIN_RAYS, _MIN_RAYS_OF_PATH = 4096, 16, 1024


@dataclass(frozen=True)
class Probe:
    """A probe of a frame by exact rays. largest_error: the largest error seen of a channel, in [0, 1]."""

    samples: ErrorSamples
    largest_error: float


def num_probe_rays(scene: Scene) -> int:
    """Return the number of rays for each frame of a scene: 0 where there is no exact picture to compare with."""
    if scene.overlay != "none":
        return 0
    if scene.error.probes is not None:
        return scene.error.probes
    width, height = scene.output.size
    return max(_MIN_RAYS, width * height // _PIXELS_PER_RAY, _MIN_RAYS_OF_PATH // scene.camera.path.frames)


class FrameProber:
    """A prober of the frames of a stage. seed: of the choice of pixels, which also depends on the frame's number."""

    def __init__(self, stage: Stage, num_rays: int, *, seed: int = 0, num_threads: int = 2) -> None:
        transfer = make_transfer_function(stage.scene.transfer_function, stage.volume.finest_spacing)
        self._integrator = RayIntegrator(stage.volume, transfer, stage.scene.shading, num_threads=num_threads)
        self._step = _STEP if stage.scene.shading is None else _SHADED_STEP
        self._stage, self._num_rays, self._seed = stage, num_rays, seed

    def probe(self, number: int, image: Pixels, radiance: Float32 | None = None) -> Probe:
        """Measure the error of a frame: of its picture or, where that is given, of the radiance before rounding.

        image: uint8 [h, w, 3], or 4 with straight alpha, which is compared over black. radiance: [h, w, 4].
        """
        background = self._stage.scene.output.background
        chosen = choose_pixels(image, self._num_rays, (self._seed, number))
        (exact,) = self._integrator.integrate(view_of(self._stage, number), chosen.numbers, [self._step])
        if radiance is None:
            shown = _colors(image.reshape(-1, image.shape[2])[chosen.numbers])
        else:
            shown = over_background(radiance.reshape(-1, 1, 4)[chosen.numbers], background)[:, 0]
        errors = (shown - over_background(exact[:, None], background)[:, 0]) ** 2
        return Probe(error_samples(chosen.factors * errors.mean(axis=1)), float(np.sqrt(errors.max())))


def _colors(pixels: Pixels) -> Float64:
    """Return the colours of pixels [n, channels] over black, float64 [n, 3] in [0, 1]."""
    values = pixels / 255
    return values[:, :3] * values[:, 3:] if pixels.shape[1] == 4 else values
