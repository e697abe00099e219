"""Round the numbers of records: more digits than anybody reads would make the files long."""

from __future__ import annotations

# The number of decimal places of a share in a record, in [0, 1]: a millionth of a picture is less than a pixel of most
# pictures.
_PLACES_OF_SHARES = 6
# The number of decimal places of a PSNR in a record, in decibels.
_PLACES_OF_DECIBELS = 2
# The number of decimal places of a ratio of costs in a record.
_PLACES_OF_RATIOS = 2
# The number of decimal places of a time in a record, in seconds.
_PLACES_OF_SECONDS = 3


def round_ratio(ratio: float) -> float:
    """Return a ratio of costs, rounded as in records."""
    return round(ratio, _PLACES_OF_RATIOS)


def round_share(share: float) -> float:
    """Return a share in [0, 1], rounded as in records."""
    return round(float(share), _PLACES_OF_SHARES)


def round_decibels(psnr: float) -> float:
    """Return a PSNR in decibels, rounded as in tables of films."""
    return round(psnr, _PLACES_OF_DECIBELS)


def round_seconds(seconds: float) -> float:
    """Return a time in seconds, rounded as in tables of films."""
    return round(seconds, _PLACES_OF_SECONDS)
