"""The scene: a frozen and checked description of a job.

In: YAML text or a parsed tree. Out: `FilmScene`, or one `SceneError` that lists every problem with its line and column;
and the JSON Schema of scenes, with the text on each key.
Its field types also check sidecars and golden records. Importing it imports no numpy, so that `hsplat check` is fast.

- `scene_file.py` reads a scene file, applies `--set` and other options, and locates problems; `input_file.py` bounds
  what is read; `yaml_tree.py` keeps line and column of each key; `json_tree.py` reads JSON.
- `spec.py` has `FilmScene`, a scene over all frames of its film, and `Scene`, the plain values at one frame;
  `scene_reading.py` makes both from plain data, `scene_writing.py` makes plain data from both.
- Each section's keys, types, defaults and checks are in `volume_section.py`, `transfer_section.py`,
  `camera_section.py`, `error_section.py` (with `MetricTarget`, an accuracy to reach, such as psnr=38),
  `splat_section.py`, `shading_section.py`, `light_section.py`, `fog_section.py`, `mode_section.py`, `clip_section.py`,
  `labels_section.py` (and masks), `layers_section.py` (volumes and their looks, `LayerSpec`), `annotation_section.py`
  (with the formats of texts) and `output_section.py`.
- `picture_kind.py`: the size, background and depth of pictures that several files may share.
- `picture_size.py`: the size of pictures, in pixels or in print.
- `output_formats.py`: the table of all formats of pictures and films.
- `level_choice.py`: the choice of a level of a store, and its sentence.
- `volume_sources.py`: raw files, formulas and arrays; `volume_files.py`: the file of a volume, or the files of its
  steps in time; `urls.py`: URLs of stores; `file_places.py`: the names of a scene's files, as seen from another folder.
- `schema.py`: the types of fields, which other rooms use as `schema.number_field(...)`, and the reading of sections
  with its checks for unknown and missing keys; `tree_node.py`: the base of all field types, and the reader of values
  that move; `motion.py`: `Motion`, a value that moves, and `OverFrames`, a part of a scene that is read at a frame.
- `json_schema.py`: the JSON Schema of a mapping from the types of its keys; `key_explanation.py`: the schema of a whole
  scene, for editors, and the text on a key.
- `limits.py`: checks of several numbers together; `colors.py`: the colours of a scene; `colormaps.py`: named colormaps;
  `message_text.py`: values and "did you mean" in messages; `schedule.py`: the tolerance or budget of each frame.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
