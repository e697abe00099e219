"""Render studies and comparisons as HTML pages without external resources, CSV, JSON and tables of text.

`write_study` and `terminal_table` report a study. Other rooms render their own templates with `render_page`, and format
numbers as here.

- `study_html.py` writes all files, and makes the page; `tables.py`: text, CSV and JSON, and the columns of the
  page; `plots.py`: error against cost; `costs.py`: what a PSNR costs.
- `html.py`: templates, and pictures in a page; `charts.py`: axes, curves and labels, drawn as SVG by `chart.html`;
  `number_format.py`: significant digits. `templates/`: jinja.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
