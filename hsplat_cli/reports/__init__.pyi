from .files import FILES as FILES, check_writable as check_writable, write_study as write_study
from .html import (
    LIGHT as LIGHT,
    facts_of as facts_of,
    page_of as page_of,
    plot_style as plot_style,
    png_data_uri as png_data_uri,
    require_page_packages as require_page_packages,
    svg_of as svg_of,
)
from .numbers import ABSENT as ABSENT, bytes_text as bytes_text, short_count_text as short_count_text
from .tables import terminal_table as terminal_table
