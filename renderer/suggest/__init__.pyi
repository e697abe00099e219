from .film_options import PRESET_WORDS as PRESET_WORDS, FilmOptions as FilmOptions
from .histogram import (
    Statistics as Statistics,
    compute_statistics as compute_statistics,
    rebin as rebin,
)
from .label_choice import label_problems as label_problems
from .matching import ValueLine as ValueLine, match_values as match_values
from .opacity import format_percent as format_percent
from .open_layers import resolve_scene as resolve_scene
from .over import suggest_over as suggest_over
from .padding import drawn_background as drawn_background
from .recognition import hounsfield_zero as hounsfield_zero
from .suggestion import Suggestion as Suggestion
from .unread import suggest_for as suggest_for
from .volume_suggestion import (
    VolumeSuggestion as VolumeSuggestion,
    read_in_colors as read_in_colors,
    suggest as suggest,
    suggest_read as suggest_read,
)
from .wishes import WISHES as WISHES, Wish as Wish
