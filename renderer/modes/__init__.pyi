from .chords import chord_lengths as chord_lengths
from .projection import Projection as Projection
from .table import make_projection as make_projection
