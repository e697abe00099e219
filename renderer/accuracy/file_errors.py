"""Measure the error that the encoder of a film adds to the error of drawing, by exact rays.

A decoded picture differs from the truth by the error e of drawing and the change c by the encoder. Its mean squared
error is that of e, that of c, and the mean of 2 e c. The last one is not 0: encoders blur some errors of drawing away.
The change is known at all pixels, and e at pixels with exact rays.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from renderer.accuracy.encoding import EncodingErrors
from renderer.accuracy.estimate import ErrorSamples, pool_samples
from renderer.accuracy.prober import FrameProber
from renderer.film import Pixels, decode_known_film, over_black
from renderer.frame import FilmAnnotation, FilmStage
from renderer.scene import OutputFile

# The number of pixels of each decoded frame that get exact rays.
_NUM_PROBES = 64


def measure_encoding(
    film: FilmStage, output: OutputFile, psnrs: Mapping[int, float | None], first_frames: Sequence[Pixels], threads: int
) -> EncodingErrors:
    """Decode the first frames of an encoded film, and measure the errors that encoding adds to them.

    psnrs: the PSNR of each frame of the film by its number, in decibels, which an annotation may show.
    first_frames: the drawn pictures of the first frames. threads: the number of threads that compute rays.
    """
    prober, annotation = FrameProber(film.first, _NUM_PROBES, num_threads=threads), FilmAnnotation(film)
    losses, products = list[float](), list[ErrorSamples]()
    with decode_known_film(output, len(psnrs)) as decoded:
        for (number, psnr), drawn, kept in zip(psnrs.items(), first_frames, decoded, strict=False):
            covered = annotation.covered(number, psnr)
            is_open = np.ones(drawn.shape[:2], np.bool_) if covered is None else ~covered
            differences = (over_black(drawn) - over_black(kept))[is_open]
            losses.append(float(np.mean(differences**2)) if differences.size else 0.0)
            prober = prober.on(film.at(number))
            products.append(prober.error_products(number, drawn, kept, covered))
    return EncodingErrors(float(np.mean(losses)), pool_samples(products))
