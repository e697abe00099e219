from .annotator import Annotator as Annotator, annotation_problems as annotation_problems
from .facts import AnnotationFacts as AnnotationFacts, ColorBar as ColorBar, FrameFacts as FrameFacts
from .layer_facts import film_facts as film_facts, frame_facts as frame_facts, length_unit as length_unit
from .names import (
    NUM_FRAMES as NUM_FRAMES,
    LabelPoints as LabelPoints,
    NamedLabel as NamedLabel,
    find_anchors as find_anchors,
    label_points as label_points,
    named_labels as named_labels,
    ordered_names as ordered_names,
)
from .room import LEAST_SHARE as LEAST_SHARE, Box as Box, free_rooms as free_rooms, taken_boxes as taken_boxes
from .sketch import draw_annotation as draw_annotation
from .text import Font as Font

# isort: split
# For tests alone: steps and constants that no other room uses.
from .numbers import find_ticks as find_ticks, length_text as length_text, plain_text as plain_text
from .seen_borders import border_points as border_points
from .sketch import Patch as Patch
