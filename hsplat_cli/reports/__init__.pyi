from .html import (
    SERIES_COLORS as SERIES_COLORS,
    Chart as Chart,
    format_facts as format_facts,
    plot_style as plot_style,
    png_data_uri as png_data_uri,
    render_page as render_page,
    require_page_packages as require_page_packages,
    webp_data_uri as webp_data_uri,
)
from .number_format import (
    bytes_text as bytes_text,
    metric_text as metric_text,
    ms_text as ms_text,
    short_count_text as short_count_text,
)
from .study_html import REPORT_FILES as REPORT_FILES, write_study as write_study
from .tables import terminal_table as terminal_table
