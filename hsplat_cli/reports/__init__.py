"""Render studies and comparisons as HTML pages without external resources, CSV, JSON and tables of text.

`write_study` and `terminal_table` report a study. Other rooms render their own templates with `render_page`, and format
numbers as here.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
