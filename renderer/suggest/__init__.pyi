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

# isort: split
# For tests alone: steps and constants that no other room uses.
from .channels import suggest_weight as suggest_weight, suggest_window as suggest_window
from .classes import (
    foreground_threshold as foreground_threshold,
    material_edges as material_edges,
    otsu_thresholds as otsu_thresholds,
)
from .features import (
    VoxelSample as VoxelSample,
    find_background as find_background,
    sample_volume as sample_volume,
    without as without,
)
from .fill_value import suggest_fill as suggest_fill
from .isolated import OutlierValue as OutlierValue
from .label_choice import label_colors as label_colors
from .opacity_calibration import (
    Layer as Layer,
    TurntableRays as TurntableRays,
    balance as balance,
    cast_rays as cast_rays,
    measure_visibility as measure_visibility,
    solve_depths as solve_depths,
)
from .over import UPPER_SHARE as UPPER_SHARE
from .palette import distinct_colors as distinct_colors, to_lab as to_lab
from .separation import (
    Plane as Plane,
    are_beyond as are_beyond,
    are_deep as are_deep,
    corner_box as corner_box,
    separating_planes as separating_planes,
)
from .wishes import Materials as Materials
