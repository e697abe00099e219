"""Renders HTML pages without external resources, and formats numbers.

In: a template's name and its values, pictures, curves, numbers. Out: the text of a page with its pictures and charts;
numbers as text with significant digits only.

- `html.py`: templates, and pictures in a page; `charts.py`: axes, curves and labels, drawn as SVG by `chart.html`;
  `number_format.py`: significant digits; `report_name.py`: checks the name of a report. `templates/`: jinja templates.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
