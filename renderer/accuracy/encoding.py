"""Measure what a film file loses of its frames, and say what is typical, and which setting would do better or as well.

Typical values are those of many scans drawn as bricks (docs/benchmarks/goals.md). What a film has is measured when it
is made.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
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
# The weights of red, green and blue in luma (Rec. 709), as films have it.
_LUMA = (0.2126, 0.7152, 0.0722)
# The share of the loss that chroma of half the resolution causes, from which full resolution is tried. At 0.47 to 0.71
# (four films of three scans) it gained 2.2 to 3.2 dB in 1.2 to 1.5 times the bytes, at 0.16 to 0.28 at most 1.2 dB.
_LARGE_CHROMA_SHARE = 0.4
# The step of quality, from 0 to 10, of a finer encoding. Two steps are 2.8 dB of H.264.
_QUALITY_STEP = 2.0
# The step of the constant rate factor that is the same.
_CRF_STEP = 6.0


def encoding_loss(output: OutputFile, num_frames: int, first_frames: Sequence[Pixels]) -> float:
    """Return the mean squared error of the first frames of a film as they are decoded, over black, in [0, 1].

    Of transparent ones the error of alpha counts, too: it is that over any background in the end.
    """
    # Imported here: `hsplat check` needs the rest of this file alone.
    import numpy as np

    from renderer.film import decode_known_film, over_black

    with decode_known_film(output, num_frames) as decoded:
        pairs = zip(first_frames, decoded, strict=False)
        return float(np.mean([np.mean((over_black(drawn) - over_black(kept)) ** 2) for drawn, kept in pairs]))


def finer_encoding(output: OutputFile, frames: Sequence[Pixels], loss: float) -> dict[str, Any]:
    """Return the key of an output, with its value, that lets its file keep more; none where no key does.

    loss: of these frames, as of `encoding_loss`.
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
    """Return the mean squared error of frames of even sides whose chroma has half the resolution, over black.

    Chroma is the difference of a colour from its luma: the mean over 2 x 2 pixels, interpolated between their centres.
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
