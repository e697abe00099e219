"""Suggest a transfer function, a light and clip planes that show the content of a volume.

In: a volume and its statistics, and perhaps a wish. Out: `Suggestion`: the kind of data, control points and opacities,
and the reason in words. Opacities are solved for visibility, Correa and Ma 2011.

- `file_suggestion.py`: for a volume that is still to be read, with all of its channels; `looks_in_time.py`: for all of
  its steps in time; `volume_suggestion.py`: for one that is in memory, with its labels and colours;
  `value_suggestion.py`: for its values alone.
- `suggestion.py` holds the result of all of these, and hides outliers; `film_options.py`: the defaults of the film
  around it.
- `recognition.py` chooses a preset by the kind of data, `wishes.py` by a word; `imported_look.py` takes a preset by
  name, or a file, in its place.
- `presets.py`: a preset, its layers and colours; `scan_presets.py` and `field_presets.py`: presets for each kind of
  data; `layer.py`: one layer of values; `preset_points.py`: control points from a preset.
- `opacity_calibration.py`: how dense layers are, so that each has its share of the picture, along
  `turntable_rays.py`; `opacity.py`: optical depths as opacities.
- `separation.py`: the object, and planes that clip its surroundings away.
- `label_look.py`: masks and segmentations; `palette.py`: colours that differ as they are seen.
- `channels.py`: a layer for each channel of a file; `over.py`: two volumes, one over the other.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
