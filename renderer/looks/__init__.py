"""Transfer functions made by other programs, and named ones of our own.

In: the content of a file and a name in it, or the name of a preset. Out: a `Look`, colours and opacities by value, with
what the file says of their unit and light, and what was left out; `place_look` makes points in data units of it. Or
the labels of a table, with names.
Importing it imports no numpy. Files are untrusted: every importer checks what it takes, and says where a mistake is.

- `look_import.py` chooses the importer by a table of suffixes and signs, and reads presets, which are in
  `presets.yaml`.
- `look.py`: `Look`, and its points where the scene wants them; `curves.py`: piecewise linear curves merged, opacities
  made piecewise linear in extinction; `color_spaces.py`: colours between two points.
- `look_file.py` reads text, numbers, curves, JSON and XML of a file, and makes its errors.
- An importer for each program: `paraview.py`, `slicer.py`, `voreen.py`, `inviwo.py`, `mricrogl.py`, `niivue.py`,
  `imagej.py`, `fsleyes.py`. `color_tables.py` has what several of them share: colours at even distances, at
  intensities, and of labels.
- `label_tables.py`: names and colours of labels, in files, also beside a volume, and in headers of images.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
