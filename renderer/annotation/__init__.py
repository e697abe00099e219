"""Draw titles, times, bars, legends, the orientation and a logo over finished pictures.

In: the scene's `annotation`, the layers and the view of a frame, and its picture. Out: the same picture with patches
over it, the problems for which a patch cannot be drawn, or the rectangles that all patches leave. All is computed in
whole numbers: the same bytes everywhere.

- `room.py`: the parts of a picture that entries take, and the rectangles that they leave
- `layer_facts.py`: the facts of a film and of a frame, from its layers and its view
- `annotator.py`: the entries, placed around the picture and drawn for each frame
- `entries.py`: a drawing function for each kind of entry
- `facts.py`: the facts about a film and about a frame that annotations show
- `names.py`: the labels that are named beside the object, their order, and the places that lines lead to
- `seen_borders.py`: points on the borders of labels, and the points that a picture shows
- `numbers.py`: round numbers, ticks and units
- `sketch.py`: masks, joined and coloured, with a rim, and put over a picture
- `text.py`: lines of text, in the font of `fonts/` (DejaVu Sans, with its licence) or in another
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
