"""Suggest a transfer function, a light and clip planes that show the content of a volume.

In: a volume and its statistics, and perhaps a user's wish. Out: `Suggestion`: the kind of data, control points with
opacities, and the reason in words. Opacities are solved so that each layer has its share of the picture (Correa and Ma
2011).

- `file_suggestion.py`: suggests for a volume that is still to be read, with all of its channels; `looks_in_time.py`:
  for all steps in time of a volume; `volume_suggestion.py`: for a volume in memory, with its labels and colours;
  `value_suggestion.py`: for the values of a volume alone.
- `suggestion.py`: the suggestion that they all return, and outliers hidden in it; `film_options.py`: the options of the
  suggested film, and their defaults; `suggested_light.py`: an environment and a key light for it.
- `recognition.py` chooses a preset by the kind of data, `wishes.py` by a user's word; `imported_look.py` instead takes
  a named preset, or a file of another program.
- `presets.py`: a preset, its layers and colours; `scan_presets.py` and `field_presets.py`: presets for each kind of
  data; `layer.py`: one layer of values; `preset_points.py`: control points from a preset.
- `opacity_calibration.py`: solves how dense layers are, so that each has its share of the picture; `turntable_rays.py`:
  the rays for this; `opacity.py`: optical depths as opacities.
- `separation.py`: the object, and planes that clip its surroundings away.
- `label_look.py`: masks and segmentations; `palette.py`: colours that people can tell apart.
- `channels.py`: a layer for each channel of a file; `over.py`: a volume inside the translucent shell of another one;
  `several.py`: several volumes in one picture, as channels, or labels over a scan.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
