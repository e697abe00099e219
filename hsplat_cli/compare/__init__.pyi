from .ci_files import (
    github_error as github_error,
    github_lines as github_lines,
    summary_markdown as summary_markdown,
)
from .comparison import (
    ComparisonRequest as ComparisonRequest,
    compare as compare,
)
from .golden.acceptance import (
    parse_decisions as parse_decisions,
    plan_acceptance as plan_acceptance,
)
from .golden.project import (
    SceneRules as SceneRules,
    find_project as find_project,
    parse_rules as parse_rules,
    unused_error as unused_error,
)
from .golden.scene_comparison import error_line as error_line
from .golden.update import (
    GoldenOptions as GoldenOptions,
    GoldenUpdate as GoldenUpdate,
    plan_removals as plan_removals,
    plan_update as plan_update,
    scenes_to_draw as scenes_to_draw,
    update_goldens as update_goldens,
)
from .limit import LIMIT_FIELD as LIMIT_FIELD, Limit as Limit
from .outcome import ComparedFilm as ComparedFilm, ComparedFrame as ComparedFrame, Comparison as Comparison
from .report_source import open_reports as open_reports
from .terminal_text import comparison_text as comparison_text

# isort: split
# For tests alone: steps and constants that no other room uses.
from .ci_files import code_quality as code_quality, junit as junit
from .difference import (
    PART_PX as PART_PX,
    Figures as Figures,
    measure_difference as measure_difference,
    measure_flip as measure_flip,
)
from .frame_comparison import compare_frame as compare_frame
from .golden.changes import changes_since as changes_since
from .golden.golden_folder import GoldenFolder as GoldenFolder
from .golden.record import (
    GOLDEN_RECORD as GOLDEN_RECORD,
    Golden as Golden,
    GoldenPicture as GoldenPicture,
    GoldenRecord as GoldenRecord,
    GoldenVolume as GoldenVolume,
    Origin as Origin,
    golden_file_name as golden_file_name,
    picture_digest as picture_digest,
)
from .golden.value_text import changed_value as changed_value
from .outcome import (
    REPORT as REPORT,
    Change as Change,
    Flickers as Flickers,
    Mistake as Mistake,
    Nearness as Nearness,
    ReportPicture as ReportPicture,
)
from .page import report_page as report_page
from .report_source import read_report as read_report, read_report_picture as read_report_picture
