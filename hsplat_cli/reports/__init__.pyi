from .charts import (
    MARKERS as MARKERS,
    SERIES as SERIES,
    Axis as Axis,
    Chart as Chart,
    Curve as Curve,
    Point as Point,
    Tick as Tick,
    linear_axis as linear_axis,
    log_axis as log_axis,
    round_numbers as round_numbers,
)
from .html import (
    format_facts as format_facts,
    page_environment as page_environment,
    png_data_uri as png_data_uri,
    render_page as render_page,
    require_own_page as require_own_page,
    webp_data_uri as webp_data_uri,
)
from .number_format import (
    ABSENT as ABSENT,
    bytes_text as bytes_text,
    count_text as count_text,
    metric_text as metric_text,
    ms_text as ms_text,
    short_count_text as short_count_text,
)
from .report_name import require_report_name as require_report_name
