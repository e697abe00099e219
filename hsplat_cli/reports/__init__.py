"""Render HTML pages without external resources, and format numbers.

In: a template's name and its values, pictures, curves, numbers. Out: the text of a page, with pictures and charts in
it; numbers with significant digits only.

- `html.py`: templates, and pictures in a page; `charts.py`: axes, curves and labels, drawn as SVG by `chart.html`;
  `number_format.py`: significant digits. `templates/`: jinja.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
