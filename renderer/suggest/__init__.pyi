from .channels import channel_layers as channel_layers, with_own_names as with_own_names
from .file_suggestion import suggest_for as suggest_for
from .film_options import NO_LIGHT as NO_LIGHT, PRESET_WORDS as PRESET_WORDS, FilmOptions as FilmOptions
from .label_look import labels_with_looks as labels_with_looks
from .looks_in_time import suggest_in_time as suggest_in_time
from .over import suggest_over as suggest_over
from .palette import colors_by_label as colors_by_label
from .presets import DEFAULT_COVERAGE as DEFAULT_COVERAGE
from .several import suggest_several as suggest_several
from .suggested_light import with_light as with_light
from .suggestion import ShownLayer as ShownLayer, Suggestion as Suggestion
from .value_suggestion import suggest as suggest
from .volume_suggestion import (
    VolumeSuggestion as VolumeSuggestion,
    read_in_colors as read_in_colors,
    suggest_read as suggest_read,
)
from .wishes import NO_WISH as NO_WISH, WISHES as WISHES, Wish as Wish

# isort: split
# For tests alone: steps and constants that no other room uses.
from .channels import suggest_weight as suggest_weight, suggest_window as suggest_window
from .layer import Layer as Layer
from .opacity_calibration import (
    balance as balance,
    measure_visibility as measure_visibility,
    solve_depths as solve_depths,
)
from .over import UPPER_SHARE as UPPER_SHARE
from .palette import distinct_colors as distinct_colors, label_colors as label_colors, to_lab as to_lab
from .separation import (
    Plane as Plane,
    are_beyond as are_beyond,
    corner_box as corner_box,
    separating_planes as separating_planes,
)
from .turntable_rays import TurntableRays as TurntableRays, cast_rays as cast_rays
from .wishes import Materials as Materials
