"""Pages, tables and plots.

In: a study or a comparison. Out: one HTML file without external resources, CSV, JSON, and tables for the terminal.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
