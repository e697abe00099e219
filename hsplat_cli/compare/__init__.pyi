from .comparison import compare_frames as compare_frames
from .frame_difference import COMPARISON_METRICS as COMPARISON_METRICS, FrameDifference as FrameDifference
from .golden.provenance import parse_date as parse_date
from .golden.update import GoldenOptions as GoldenOptions, update_goldens as update_goldens
from .report_files import ReportFiles as ReportFiles, comparison_table as comparison_table
from .scene_pairs import load_reproducible_job as load_reproducible_job
from .strictness import (
    STRICTNESSES as STRICTNESSES,
    exceeded_limits as exceeded_limits,
    severity as severity,
)
