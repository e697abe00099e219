"""Measure the error that the encoder of a film adds to its frames, and suggest better settings for a film.

Suggestions rest on typical values of many scans drawn as bricks (docs/benchmarks/goals.md). The error of a film itself
is measured when the film is made.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from renderer.accuracy.decibels import psnr, wanted_error
from renderer.scene import MAX_QUALITY, ErrorSpec, MetricTarget, OutputFile, min_tolerance

if TYPE_CHECKING:
    from renderer.accuracy.estimate import ErrorSamples
    from renderer.film import Pixels

# The quality of an output, from 0 to 10, at which a codec has the typical PSNR `kept_psnr` of the table of codecs.
_USUAL_QUALITY = 8.0
# The tolerance at which bricks have a PSNR of about _TOLERANCE_DB.
_TOLERANCE = 0.1
# The typical PSNR of bricks at the tolerance _TOLERANCE, in decibels.
_TOLERANCE_DB = 53.0
# The typical gain of PSNR, in decibels, if the tolerance of bricks becomes ten times as fine.
_DB_PER_DECADE = 17.0
# The time of drawing grows with about this power of 1 / tolerance. For four scans at 256 x 256 it was 0.71 to 1.12.
_TIME_POWER = 0.75
# If the PSNR of the drawn frames is higher than the PSNR of encoding by this much, in decibels, or more, a note says
# that coarser frames would do.
_TOO_GOOD_DB = 16.0
# Frames are to be drawn with a PSNR higher than the PSNR of encoding by this much, in decibels: drawing then adds a
# sixth to the error of the film.
_GOOD_ENOUGH_DB = 8.0
# The weights of red, green and blue in the luma (brightness) of films, by Rec. 709.
_LUMA = (0.2126, 0.7152, 0.0722)
# Chroma (colour) of full resolution is suggested if half the resolution causes at least this share of the encoder's
# loss. At shares of 0.47 to 0.71 (four films of three scans), full resolution gained 2.2 to 3.2 dB in 1.2 to 1.5 times
# the bytes; at 0.16 to 0.28, at most 1.2 dB.
_LARGE_CHROMA_SHARE = 0.4
# The quality of an output, from 0 to 10, is raised by this much for a finer encoding: for H.264, 2.8 dB.
_QUALITY_STEP = 2.0
# The constant rate factor of an output is lowered by this much for a finer encoding: it gains about as much as
# _QUALITY_STEP.
_CRF_STEP = 6.0


class EncodingErrors(NamedTuple):
    """The errors that encoding adds to frames of a film, outside their annotation.

    loss: the mean squared difference of the decoded frames from the drawn ones, of colours in [0, 1].
    products: samples of twice the product of this difference and the error of drawing; None if no rays measured them.
    """

    loss: float
    products: ErrorSamples | None = None

    def at_loss(self, loss: float) -> EncodingErrors:
        """Return the errors of an encoding that changes pictures alike, with another loss."""
        if self.products is None or self.loss == 0:
            return EncodingErrors(loss, self.products)
        return EncodingErrors(loss, self.products.times(math.sqrt(loss / self.loss)))


def encoding_loss(output: OutputFile, num_frames: int, first_frames: Sequence[Pixels]) -> float:
    """Return the mean squared error of the first decoded frames of a film against the drawn ones, colours in [0, 1].

    Frames are compared over black. The error of the alpha of transparent frames counts, too, because it is visible over
    other backgrounds.
    """
    # numpy is imported here because `hsplat check` needs only the other functions of this file.
    import numpy as np

    from renderer.film import decode_known_film, over_black

    with decode_known_film(output, num_frames) as decoded:
        pairs = zip(first_frames, decoded, strict=False)
        return float(np.mean([np.mean((over_black(drawn) - over_black(kept)) ** 2) for drawn, kept in pairs]))


def finer_encoding(output: OutputFile, frames: Sequence[Pixels], loss: float) -> dict[str, Any]:
    """Return a key of an output, with a value by which the encoder loses less; nothing if no key can do this.

    frames: drawn frames. loss: the encoder's error on these frames, as `encoding_loss` returns it.
    """
    full = output.chosen_pixel_format.replace("420", "444")
    is_halved = full != output.chosen_pixel_format and full in output.pixel_formats
    if is_halved and _halved_chroma_loss(frames) >= _LARGE_CHROMA_SHARE * loss:
        return {"pixel_format": full}
    if output.crf is not None:
        return {"crf": max(output.crf - _CRF_STEP, 0.0)} if output.crf > 0 else {}
    has_quality = output.chosen_codec.crf is not None or output.chosen_codec.has_percent_quality
    if has_quality and output.quality < MAX_QUALITY:
        return {"quality": min(output.quality + _QUALITY_STEP, MAX_QUALITY)}
    return {}


def _halved_chroma_loss(frames: Sequence[Pixels]) -> float:
    """Return the mean squared error that chroma of half the resolution causes, over black, colours in [0, 1].

    Chroma is the difference of a colour from its luma. At half the resolution, it is averaged over blocks of 2 x 2
    pixels, and interpolated between the centres of blocks. frames: of even widths and heights.
    """
    import numpy as np

    from renderer.film import over_black

    losses = []
    for frame in frames:
        colors = over_black(frame)[..., :3]
        chroma = colors - (colors @ np.array(_LUMA))[..., None]
        height, width = frame.shape[:2]
        halved = chroma.reshape(height // 2, 2, width // 2, 2, 3).mean(axis=(1, 3))
        for axis, side in enumerate((height, width)):
            before = np.take(halved, np.maximum(np.arange(side // 2) - 1, 0), axis)
            after = np.take(halved, np.minimum(np.arange(side // 2) + 1, side // 2 - 1), axis)
            pairs = np.stack([0.75 * halved + 0.25 * before, 0.75 * halved + 0.25 * after], axis + 1)
            halved = pairs.reshape(*halved.shape[:axis], side, *halved.shape[axis + 1 :])
        losses.append(np.mean((halved - chroma) ** 2))
    return float(np.mean(losses))


def typical_psnr(tolerance: float) -> float:
    """Return the typical PSNR of pictures drawn as bricks at a tolerance, in decibels; infinity at tolerance 0."""
    return _TOLERANCE_DB + _DB_PER_DECADE * math.log10(_TOLERANCE / tolerance) if tolerance > 0 else math.inf


def asked_psnr(error: ErrorSpec) -> float:
    """Return the PSNR that a scene asks for, in decibels; infinity at tolerance 0.

    Without a PSNR or an RMSE it is the typical one of its smallest tolerance; a budget counts as the default tolerance.
    """
    if isinstance(error.goal, MetricTarget):
        return psnr(wanted_error(error.goal))
    return typical_psnr(min_tolerance(ErrorSpec() if error.goal else error))


def typical_tolerance(decibels: float) -> float:
    """Return the tolerance at which pictures drawn as bricks typically have a PSNR."""
    return float(_TOLERANCE * 10 ** ((_TOLERANCE_DB - decibels) / _DB_PER_DECADE))


def typical_kept_psnr(output: OutputFile) -> float:
    """Return the typical PSNR of a decoded film against its drawn frames; infinity for numbered image files."""
    if output.is_frames:
        return math.inf
    usual, per_step = output.chosen_codec.kept_psnr
    return usual + per_step * (output.quality - _USUAL_QUALITY)


def finer_drawing(tolerance: float, psnr: float, kept: float) -> tuple[float, float]:
    """Return the tolerance at which the encoder, not drawing, limits a film, and the factor by which the time grows.

    tolerance, psnr: the tolerance of the drawn frames, and their PSNR against the truth. kept: the PSNR of the decoded
    frames against the drawn ones, in decibels.
    """
    finer = tolerance * typical_tolerance(kept + _GOOD_ENOUGH_DB) / typical_tolerance(psnr)
    return float(f"{finer:.1g}"), (tolerance / finer) ** _TIME_POWER


def finer_than_kept(psnr: float, kept: float) -> str | None:
    """Return a note if frames are drawn far more exactly than the encoder keeps them; else None.

    psnr: the PSNR of the drawn frames against the truth. kept: the PSNR of the decoded frames against the drawn ones.
    """
    if psnr < kept + _TOO_GOOD_DB:
        return None
    wanted = kept + _GOOD_ENOUGH_DB
    tolerance = float(f"{typical_tolerance(wanted):.1g}")
    had = "exact frames" if math.isinf(psnr) else f"frames PSNR {psnr:.0f} dB"
    return (
        f"file PSNR about {kept:.0f} dB, {had} before encoding: tolerance {tolerance:g}, or psnr {wanted:.0f}, gives "
        "nearly the same film sooner"
    )
