from .groups import LayerGroup as LayerGroup, group_layers as group_layers
from .label_numbers import mask_volume as mask_volume
from .layer import (
    Layer as Layer,
    frames_of_new_layers as frames_of_new_layers,
    layer_digest as layer_digest,
    make_layer as make_layer,
    parts_over_frames as parts_over_frames,
    with_level as with_level,
)
from .placement import (
    placement_notes as placement_notes,
    placement_problems as placement_problems,
    reach_text as reach_text,
)
from .scattered_light import (
    NO_SOLVED_LIGHT as NO_SOLVED_LIGHT,
    SolvedLight as SolvedLight,
    frames_of_new_light as frames_of_new_light,
    light_of_layers as light_of_layers,
)

# isort: split
# For tests alone: steps and constants that no other room uses.
from .label_numbers import leave_out_masked as leave_out_masked, number_labels as number_labels
