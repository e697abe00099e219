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

# isort: split
# For tests alone: steps and constants that no other room uses.
from .comparison import require_match as require_match
from .comparison_html import (
    CROP_PX as CROP_PX,
    NUM_PASSING_SHOWN as NUM_PASSING_SHOWN,
    PICTURE_PX as PICTURE_PX,
    Gallery as Gallery,
    GalleryFrame as GalleryFrame,
    comparison_page as comparison_page,
    plot_errors as plot_errors,
)
from .file_pairs import open_pairs as open_pairs
from .frame_difference import WINDOW_PX as WINDOW_PX
from .golden.provenance import (
    PROVENANCE as PROVENANCE,
    PROVENANCE_FILE as PROVENANCE_FILE,
    Golden as Golden,
    GoldenOrigin as GoldenOrigin,
    GoldenVolume as GoldenVolume,
    Provenance as Provenance,
    golden_file_name as golden_file_name,
    origin_from_record as origin_from_record,
)
from .golden.update import GoldenUpdate as GoldenUpdate, describe_update as describe_update, plan_update as plan_update
from .outcome import (
    Comparison as Comparison,
    Outcome as Outcome,
    Pair as Pair,
    Status as Status,
    compare_pair as compare_pair,
    figure_text as figure_text,
    limit_text as limit_text,
    limits_text as limits_text,
    share_text as share_text,
    signed_text as signed_text,
    value_text as value_text,
)
from .picture_file import read_picture as read_picture
from .report_files import MAX_ROWS as MAX_ROWS, comparison_json as comparison_json, comparison_junit as comparison_junit
from .rules import Rules as Rules, load_rules as load_rules
