"""Round the numbers of records: more digits than anybody reads would make the files long."""

from __future__ import annotations

# Decimal places of a share, in [0, 1]: a millionth of a picture is less than a pixel of most pictures.
_PLACES_OF_SHARES = 6
# Decimal places of a PSNR, in decibels.
_PLACES_OF_DECIBELS = 2
# Decimal places of a ratio of costs.
_PLACES_OF_RATIOS = 2
# Decimal places of a time, in seconds.
_PLACES_OF_SECONDS = 3


def round_ratio(ratio: float) -> float:
    """Return a ratio as records have it."""
    return round(ratio, _PLACES_OF_RATIOS)


def round_share(share: float) -> float:
    """Return a share in [0, 1] as records have it."""
    return round(float(share), _PLACES_OF_SHARES)


def round_decibels(psnr: float) -> float:
    """Return a PSNR as tables of films have it."""
    return round(psnr, _PLACES_OF_DECIBELS)


def round_seconds(seconds: float) -> float:
    """Return a time as tables of films have it."""
    return round(seconds, _PLACES_OF_SECONDS)
