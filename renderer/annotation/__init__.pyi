from .annotator import Annotator as Annotator, annotation_problems as annotation_problems
from .facts import AnnotationFacts as AnnotationFacts, ColorBar as ColorBar, FrameFacts as FrameFacts
from .film_annotation import (
    FilmAnnotation as FilmAnnotation,
    annotation_notes as annotation_notes,
    require_annotation as require_annotation,
)
from .sketch import draw_annotation as draw_annotation
from .text import Font as Font

# isort: split
# For tests alone: steps and constants that no other room uses.
from .numbers import find_ticks as find_ticks, length_text as length_text, plain_text as plain_text
from .sketch import Patch as Patch
