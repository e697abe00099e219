from .ci_files import github_lines as github_lines, summary_markdown as summary_markdown
from .comparison import ComparisonRequest as ComparisonRequest, compare as compare, require_match as require_match
from .golden.acceptance import (
    Decision as Decision,
    parse_decision as parse_decision,
    plan_acceptance as plan_acceptance,
)
from .golden.project import SceneRules as SceneRules, find_project as find_project, parse_rules as parse_rules
from .golden.update import (
    GoldenOptions as GoldenOptions,
    GoldenUpdate as GoldenUpdate,
    plan_update as plan_update,
    scenes_to_draw as scenes_to_draw,
    update_goldens as update_goldens,
)
from .limit import LIMIT_FIELD as LIMIT_FIELD, Limit as Limit
from .outcome import ComparedFilm as ComparedFilm, ComparedFrame as ComparedFrame, Comparison as Comparison
from .report_source import open_report_source as open_report_source
from .terminal_text import comparison_text as comparison_text
