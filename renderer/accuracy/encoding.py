"""Measure what a film file loses of its frames, and say what is typical, and which setting would do better or as well.

Typical values are those of many scans drawn as bricks (docs/benchmarks/goals.md). What a film has is measured when it
is made.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from renderer.scene import MAX_QUALITY, OutputFile

if TYPE_CHECKING:
    from renderer.film import Pixels

# To which typical losses of the table of formats belong.
_USUAL_QUALITY = 8.0
# Bricks have about this PSNR at this tolerance.
_TOLERANCE, _TOLERANCE_DB, _DB_PER_DECADE = 0.1, 53.0, 17.0
# As the tolerance falls, the time of drawing grows with about this power: 0.71 to 1.12 of four scans at 256 x 256.
_TIME_POWER = 0.75
# Frames that are better by the first than what the file keeps are worth a word. With the second, the error of the film
# is a sixth more.
_TOO_GOOD_DB, _GOOD_ENOUGH_DB = 16.0, 8.0
# The share of the loss that is in colours, from which chroma of full resolution is worth a trial: at a half it gains up
# to 3 dB.
_LARGE_COLOR_SHARE = 0.5
# The step of quality, from 0 to 10, of a finer encoding. Two steps are 2.8 dB of H.264.
_QUALITY_STEP = 2.0
# The step of the constant rate factor that is the same.
_CRF_STEP = 6.0


@dataclass(frozen=True)
class EncodingLoss:
    """The loss of an encoder: the mean squared error of decoded frames, of colours in [0, 1] over black.

    color_share: the share of the error that is left in RGB after the mean of the three channels is taken from it.
        Chroma of half the resolution loses colours, coarse quantisation loses all alike.
    """

    squared_error: float
    color_share: float


def encoding_loss(output: OutputFile, num_frames: int, first_frames: Sequence[Pixels]) -> EncodingLoss:
    """Return the loss of the first frames of a film as they are decoded.

    Of transparent ones the error of alpha counts, too: it is that over any background in the end.
    """
    # Imported here: `hsplat check` needs the rest of this file alone.
    import numpy as np

    from renderer.film import decode_known_film, over_black

    with decode_known_film(output, num_frames) as decoded:
        pairs = zip(first_frames, decoded, strict=False)
        errors = [over_black(drawn) - over_black(kept) for drawn, kept in pairs]
    total = sum(np.sum(error**2) for error in errors)
    colors = sum(np.sum((error[..., :3] - error[..., :3].mean(-1, keepdims=True)) ** 2) for error in errors)
    return EncodingLoss(float(total / sum(error.size for error in errors)), float(colors / total) if total else 0.0)


def finer_encoding(output: OutputFile, color_share: float) -> dict[str, Any]:
    """Return the key of an output, with its value, that lets its file keep more; none where no key does.

    color_share: as of `EncodingLoss`.
    """
    full = output.chosen_pixel_format.replace("420", "444")
    if color_share >= _LARGE_COLOR_SHARE and full != output.chosen_pixel_format and full in output.pixel_formats:
        return {"pixel_format": full}
    if output.crf is not None:
        return {"crf": max(output.crf - _CRF_STEP, 0.0)} if output.crf > 0 else {}
    has_quality = output.chosen_codec.crf is not None or output.chosen_codec.has_percent_quality
    if has_quality and output.quality < MAX_QUALITY:
        return {"quality": min(output.quality + _QUALITY_STEP, MAX_QUALITY)}
    return {}


def typical_psnr(tolerance: float) -> float:
    """Return about which PSNR bricks have at a tolerance; infinity at 0."""
    return _TOLERANCE_DB + _DB_PER_DECADE * math.log10(_TOLERANCE / tolerance) if tolerance > 0 else math.inf


def typical_tolerance(decibels: float) -> float:
    """Return about which tolerance gives bricks a PSNR."""
    return float(_TOLERANCE * 10 ** ((_TOLERANCE_DB - decibels) / _DB_PER_DECADE))


def typical_kept_psnr(output: OutputFile) -> float:
    """Return about which PSNR a decoded film has from its frames; infinity for frames in files."""
    if output.is_frames:
        return math.inf
    usual, per_step = output.chosen_codec.kept_psnr
    return usual + per_step * (output.quality - _USUAL_QUALITY)


def finer_drawing(tolerance: float, psnr: float, kept: float) -> tuple[float, float]:
    """Return about which tolerance draws frames that the encoder loses more of, and by how much the time grows.

    tolerance, psnr: of the frames as they were drawn. kept: of the decoded frames, compared with these, in decibels.
    """
    finer = tolerance * typical_tolerance(kept + _GOOD_ENOUGH_DB) / typical_tolerance(psnr)
    return float(f"{finer:.1g}"), (tolerance / finer) ** _TIME_POWER


def finer_than_kept(psnr: float, kept: float) -> str | None:
    """Return what to say where frames are far more exact than what the file keeps of them, both in decibels."""
    if psnr < kept + _TOO_GOOD_DB:
        return None
    wanted = kept + _GOOD_ENOUGH_DB
    tolerance = float(f"{typical_tolerance(wanted):.1g}")
    had = "exact frames" if math.isinf(psnr) else f"frames PSNR {psnr:.0f} dB"
    return (
        f"file PSNR about {kept:.0f} dB, {had} before encoding: tolerance {tolerance:g}, or psnr {wanted:.0f}, gives "
        "nearly the same film sooner"
    )
