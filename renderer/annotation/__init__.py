"""What is drawn over finished pictures: titles, times, bars, legends, the orientation, a logo.

In: the scene's `annotation`, a stage, and the pictures of its frames. Out: the same pictures with patches over them, or
the problems that keep these from being drawn. All is computed in whole numbers: the same bytes everywhere.

- `film_annotation.py`: draws the annotation of a film, and tries first whether there is room; `stage_facts.py`: finds
  the facts that it shows, as the plain data of `facts.py`, of a film and of a frame.
- `annotator.py` places the entries, draws those that change, and finds what has no room; `entries.py` draws each.
- `numbers.py`: round numbers, ticks and units.
- `sketch.py`: masks put together, coloured, given a rim, and put over a picture; `text.py`: lines of text, in the font
  of `fonts/`, DejaVu Sans with its licence, or another.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
