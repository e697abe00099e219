"""The layers of a film: each one volume, with all that is made of it before a camera is chosen.

In: `LayerSpec`, plain data, and the scene's mode, pyramid and error measure. Out: `Layer`: volume, transfer function,
pyramid, bricks and light, known by the digest of what it was made from, by which layers are kept.

- `layer.py`: makes a layer. `label_numbers.py`: numbers labels, and masks volumes. `groups.py`: which layers are drawn
  as one. `placement.py`: how volumes lie beside each other.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
