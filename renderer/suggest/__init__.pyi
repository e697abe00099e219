from .histogram import (
    Statistics as Statistics,
    ValueRange as ValueRange,
    measure as measure,
    rebin as rebin,
    suggest_ranges as suggest_ranges,
)
from .suggestion import Suggestion as Suggestion, suggest as suggest
from .unseen import unseen_value as unseen_value
