from .histogram import (
    Statistics as Statistics,
    ValueRange as ValueRange,
    measure as measure,
    rebin as rebin,
    suggest_ranges as suggest_ranges,
)
from .nonfinite import suggest_nonfinite_fill as suggest_nonfinite_fill
from .suggestion import Suggestion as Suggestion, suggest as suggest
