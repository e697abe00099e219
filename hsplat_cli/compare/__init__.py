"""Pictures against golden ones.

In: two sets of pictures, films or a scene and its golden frames, and limits. Out: a verdict for each pair, as a table,
an HTML report and JUnit. `golden/` keeps golden frames and says what they were drawn from.

- `api.py`: the comparison; `rules.py`: strictness levels and limits; `outcome.py`: pairs and their verdicts.
- `file_pairs.py`: pairs of files; `scene_pairs.py`: goldens and frames rendered now; `picture_file.py`: strict PNG
  reading; `film_decoder.py`: frames of MP4 and GIF.
- `report_files.py` writes the reports: `text_reports.py` (terminal, JSON, JUnit), `comparison_html.py` with
  `gallery.py` and `error_plot.py`; `figure_format.py`: numbers and names in them. `pytest_plugin.py`: the fixture.
- `golden/`: `provenance.py` (golden.json), `render.py`, `update.py`, `update_plan.py`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
