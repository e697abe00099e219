"""Draw titles, times, bars, legends, the orientation and a logo over finished pictures.

In: the scene's `annotation`, a stage, and the pictures of its frames. Out: the same pictures with patches over them, or
the problems for which a patch cannot be drawn. All is computed in whole numbers: the same bytes everywhere.

- `film_annotation.py`: the annotation of a film: a test that pictures have room for it, and the drawing
- `stage_facts.py`: the facts of a film and of a frame, as plain data
- `annotator.py`: the entries, placed around the picture and drawn for each frame
- `entries.py`: a drawing function for each kind of entry
- `facts.py`: the facts about a film and about a frame that annotations show
- `numbers.py`: round numbers, ticks and units
- `sketch.py`: masks, joined and coloured, with a rim, and put over a picture
- `text.py`: lines of text, in the font of `fonts/` (DejaVu Sans, with its licence) or in another
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
