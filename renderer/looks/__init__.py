"""Import transfer functions and tables of labels from the files of other programs, and read our own presets.

In: the content of a file and a name in it, or the name of a preset. Out: a `Look`, colours and opacities by value, with
their unit, their light and a list of the features left out; `place_look` gives its points in data units. Or, from a
table of labels, their names and colours. This package loads without numpy. Files are untrusted: every importer checks
all values, and its errors name their places.

- `look_import.py`: the choice of an importer by a table of suffixes and contents, and the presets in `presets.yaml`
- `look.py`: `Look`, and its points in data units
- `look_file.py`: text, numbers, curves, JSON and XML of a file, with errors that name the place
- `curves.py`: piecewise linear curves, merged, and made linear in extinction
- `color_spaces.py`: colours between two points, in ParaView's colour spaces
- `paraview.py`, `slicer.py`, `voreen.py`, `inviwo.py`, `mricrogl.py`, `niivue.py`, `imagej.py`, `fsleyes.py`: an
  importer for each program
- `color_tables.py`: tables of colours that several importers share
- `label_tables.py`: names and colours of labels, in files, beside a volume, and in headers of images
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
