"""Make the layers of a film: each is a volume with its pyramid, bricks and light, for any camera.

In: `LayerSpec`, plain data, and the scene's mode, pyramid and error measure. Out: `Layer`: volume, transfer function,
pyramid, bricks and light, with a digest by which a layer is kept and found again.

- `layer.py`: a layer, made from plain data
- `label_numbers.py`: labels as numbers from 1 on, and masks over volumes
- `groups.py`: groups of layers that are drawn together
- `scattered_light.py`: the light that all layers of a scene scatter
- `placement.py`: the positions of volumes in the world, and problems with them
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
