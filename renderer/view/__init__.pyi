from .brick_projection import box_rectangles as box_rectangles, ray_frame as ray_frame, visible_bricks as visible_bricks
from .camera import View as View
from .depth_order import Turning as Turning, make_turning as make_turning
from .framing import (
    finest_useful_level as finest_useful_level,
    fit_distance as fit_distance,
    smallest_voxel_px as smallest_voxel_px,
    visible_centre as visible_centre,
    visible_points as visible_points,
)
from .paths import axes_in_runs as axes_in_runs, make_view as make_view
from .splat_projection import (
    SLOPE_LIMIT as SLOPE_LIMIT,
    ModelView as ModelView,
    Region as Region,
    covered_region as covered_region,
    longest_sigma as longest_sigma,
    mean_footprint_px as mean_footprint_px,
    model_view as model_view,
    square_px as square_px,
    visible_orders as visible_orders,
)
