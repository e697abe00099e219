from .measure.options import parse_sweep as parse_sweep, parse_want as parse_want
from .measure.study import StudyRequest as StudyRequest, run_study as run_study
from .measure.tolerance import print_tolerance as print_tolerance
