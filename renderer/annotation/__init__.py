"""What is drawn over finished pictures: titles, times, bars, legends, the orientation, a logo.

In: the scene's `annotation` and what it shows, as plain data. Out: patches, which `draw_annotation` puts over a
picture, or the problems that keep them from being drawn. All is computed in whole numbers: the same bytes everywhere.

- `annotator.py` places the entries, draws those that change, and finds what has no room; `entries.py` draws each.
- `facts.py`: what an annotation shows, of a film and of a frame; `numbers.py`: round numbers, ticks and units.
- `sketch.py`: masks put together, coloured, given a rim, and put over a picture; `text.py`: lines of text, in the font
  of `fonts/`, DejaVu Sans with its licence, or another.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
