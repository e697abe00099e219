"""Suggest a transfer function that shows what is in a volume.

In: a volume and its statistics. Out: `Suggestion`: the kind of data, and control points and opacities that show it.
Thresholds by Otsu 1979; densities by visibility, Correa and Ma 2011.

- `volume_suggestion.py` makes the suggestion; `unread.py`: of a volume that is still to be read, all of its channels
  and its steps in time; `suggestion.py` is what it consists of, and hides outliers; `fill_value.py` chooses what voxels
  without data count as.
- `histogram.py`: range, histogram; `isolated.py`: hot and dead pixels, which are set aside; `percentiles.py`: exact
  ranks.
- `features.py`: a sample of the voxels, its background and noise; `padding.py`: zeros at the border, which are no
  background; `classes.py`: thresholds and materials; `medium.py`: what surrounds the object evenly; `separation.py`:
  the object, and planes that clip away what lies around it.
- `recognition.py` chooses by the kind of data; `level_sets.py`: distances and the like; `label_volume.py`: masks and
  segmentations, in the colours of `palette.py`; `wishes.py`: a suggestion steered by a word, a preset or a file.
- `presets.py`: layers and colours for each kind of data; `opacity_calibration.py`: how dense they are, so that each has
  its part of the picture; `opacity.py`: depths as opacities.
- `channels.py`: a layer for each channel of a file, for `component: all`; `label_choice.py`: which labels are shown,
  and their colours; `relative.py`: values for percentiles; `open_layers.py`: all of these, where a scene leaves them
  open.
- `matching.py`: how the values of one scan become those of another, by their histograms.
- `over.py`: two volumes, one over the other; its weights are searched by `opacity_calibration.py`.
- `film_options.py`: the defaults of the film around it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
