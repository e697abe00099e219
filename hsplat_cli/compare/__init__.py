"""Compares pictures with golden ones.

In: two sets of pictures, films or a scene and its golden frames, and limits. Out: a verdict for each pair, as a table,
an HTML report and JUnit. `golden/` keeps golden frames, and records their scene and volume.

- `comparison.py`: the comparison; `rules.py`: the requested strictness and limits; `outcome.py`: pairs, their verdicts
  and numbers.
- `frame_difference.py`: the errors of a picture against its golden frame; `strictness.py`: named limits of these
  errors, and the metrics that exceed them.
- `file_pairs.py`: pairs of files; `scene_pairs.py`: pairs of goldens and newly rendered frames; `picture_file.py`:
  strict PNG reading.
- `report_files.py`: the reports (terminal, JSON, JUnit); `comparison_html.py`: the page and its pictures.
- `pytest_plugin.py`: the fixture.
- `golden/`: `provenance.py` (golden.json), `update.py`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
