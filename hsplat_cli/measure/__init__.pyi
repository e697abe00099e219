from .report import PAGE_FILE as PAGE_FILE, REPORT_FILES as REPORT_FILES, write_study as write_study
from .study import StudyRequest as StudyRequest, run_study as run_study
from .sweep import (
    FRAME_STEPS as FRAME_STEPS,
    FrameMeasurement as FrameMeasurement,
    Measurement as Measurement,
    PlannedSetting as PlannedSetting,
    Setting as Setting,
    Study as Study,
    measure_setting as measure_setting,
    plan_sweep as plan_sweep,
)
from .sweep_options import parse_sweep as parse_sweep, parse_want as parse_want
from .tables import terminal_table as terminal_table
from .thumbnails import DIFFERENCE_GAIN as DIFFERENCE_GAIN, amplified_difference as amplified_difference
from .tolerance import print_tolerance as print_tolerance

# isort: split
# For tests alone: steps and constants that no other room uses.
from .plots import study_charts as study_charts
from .study import scene_notes as scene_notes
from .tolerance import open_at_any_tolerance as open_at_any_tolerance
