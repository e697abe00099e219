from .background import (
    Background as Background,
    fill_with_background as fill_with_background,
    find_background as find_background,
)
from .classes import (
    foreground_threshold as foreground_threshold,
    material_edges as material_edges,
    otsu_threshold as otsu_threshold,
    otsu_thresholds as otsu_thresholds,
    top_value as top_value,
)
from .coarse_cells import (
    are_deep as are_deep,
    pool_voxels as pool_voxels,
)
from .fill_value import (
    suggest_fill as suggest_fill,
)
from .histogram import (
    Statistics as Statistics,
    compute_statistics as compute_statistics,
    exact_percentiles as exact_percentiles,
    rebin as rebin,
)
from .hounsfield import (
    hounsfield_zero as hounsfield_zero,
)
from .isolated import (
    OutlierValue as OutlierValue,
)
from .known_labels import (
    NO_LABELS as NO_LABELS,
    KnownLabels as KnownLabels,
    count_labels as count_labels,
    label_table_of as label_table_of,
    read_labels as read_labels,
)
from .label_volume import (
    border_mode as border_mode,
    distinct_values as distinct_values,
    is_piecewise_constant as is_piecewise_constant,
    label_values as label_values,
)
from .level_crossings import (
    MAX_CROSSINGS as MAX_CROSSINGS,
    crossings as crossings,
    has_nested_levels as has_nested_levels,
)
from .level_sets import (
    is_level_set_interior as is_level_set_interior,
)
from .matching import (
    ValueLine as ValueLine,
    match_values as match_values,
)
from .medium import (
    find_medium as find_medium,
)
from .number_text import (
    format_number as format_number,
    format_percent as format_percent,
)
from .padding import (
    background_value as background_value,
    without_padding as without_padding,
)
from .smoothness import (
    is_noise as is_noise,
    is_smooth as is_smooth,
)
from .spread import (
    is_about_zero as is_about_zero,
    noise_reach as noise_reach,
    tail_ratio as tail_ratio,
)
from .voxel_sample import (
    SAME as SAME,
    VoxelSample as VoxelSample,
    sample_volume as sample_volume,
)
