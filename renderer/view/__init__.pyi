from .brick_projection import (
    ray_setup as ray_setup,
    screen_rectangles as screen_rectangles,
    visible_bricks as visible_bricks,
)
from .camera import Fog as Fog, View as View
from .clip_slabs import (
    are_clipped_away as are_clipped_away,
    are_near_faces as are_near_faces,
    place_clips as place_clips,
    place_object_clips as place_object_clips,
)
from .framing import (
    WHOLE_PICTURE as WHOLE_PICTURE,
    Room as Room,
    corners_around as corners_around,
    finest_useful_level as finest_useful_level,
    fit_distance as fit_distance,
    framed_points as framed_points,
    least_distance as least_distance,
    smallest_voxel_px as smallest_voxel_px,
    visible_centre as visible_centre,
    visible_points as visible_points,
    volume_corners as volume_corners,
)
from .key_light import with_key_of_camera as with_key_of_camera
from .order_blending import OrderBlending as OrderBlending, make_order_blending as make_order_blending
from .paths import (
    camera_poses as camera_poses,
    make_view as make_view,
    rotation_from_z_to as rotation_from_z_to,
)
from .seen import MOST_LEFT_OUT as MOST_LEFT_OUT
from .splat_projection import (
    CLIPPED_SIGMAS as CLIPPED_SIGMAS,
    CULLED_SIGMAS as CULLED_SIGMAS,
    SLOPE_LIMIT as SLOPE_LIMIT,
    Region as Region,
    blended_orders as blended_orders,
    covered_region as covered_region,
    longest_sigma as longest_sigma,
    mean_footprint_area_px as mean_footprint_area_px,
    model_view as model_view,
    total_square_area_px as total_square_area_px,
    visible_order as visible_order,
)

# isort: split
# For tests alone: steps and constants that no other room uses.
from .depth_order import box_order as box_order, order_by_depth as order_by_depth
from .order_blending import (
    sort_directions as sort_directions,
)
