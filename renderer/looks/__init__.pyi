from .color_spaces import lab_from_rgb as lab_from_rgb, rgb_from_lab as rgb_from_lab
from .curves import linear_in_extinction as linear_in_extinction
from .label_tables import (
    find_label_table as find_label_table,
    make_labels as make_labels,
    read_extension as read_extension,
    read_label_table as read_label_table,
)
from .look import (
    MAX_LOOK_POINTS as MAX_LOOK_POINTS,
    Look as Look,
    place_look as place_look,
)
from .look_file import MAX_LOOK_BYTES as MAX_LOOK_BYTES, LookFile as LookFile
from .look_import import LookNameError as LookNameError, read_look as read_look, read_preset as read_preset

# isort: split
# For tests alone: steps and constants that no other room uses.
from .curves import merge_curves as merge_curves
