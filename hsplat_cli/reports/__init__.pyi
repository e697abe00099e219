from .html import (
    LIGHT_PALETTE as LIGHT_PALETTE,
    figure_to_svg as figure_to_svg,
    format_facts as format_facts,
    plot_style as plot_style,
    png_data_uri as png_data_uri,
    render_page as render_page,
    require_page_packages as require_page_packages,
)
from .number_format import ABSENT as ABSENT, bytes_text as bytes_text, short_count_text as short_count_text
from .study_files import FILES as FILES, require_writable_files as require_writable_files, write_study as write_study
from .tables import terminal_table as terminal_table
