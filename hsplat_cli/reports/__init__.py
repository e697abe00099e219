"""Render studies and comparisons as HTML pages without external resources, CSV, JSON and tables of text.

`write_study` and `terminal_table` report a study. Other rooms render their own templates with `render_page`, and format
numbers as here.

- `study_files.py` writes all files; `study_html.py`: the page; `tables.py`: text, CSV and JSON; `columns.py`: the
  columns of the page and of the terminal; `plots.py`: error against cost; `costs.py`: what a PSNR costs.
- `html.py`: templates, SVG and pictures in a page; `number_format.py`: significant digits. `templates/`: jinja.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
