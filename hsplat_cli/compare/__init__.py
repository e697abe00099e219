"""Compares pictures with golden ones, and keeps goldens.

In: scenes and the folders of their goldens, or two sets of pictures, and one limit. Out: a verdict on each film and
frame, as text, as a report with a page, and for CI; goldens that were drawn, or accepted from a report.

- `comparison.py`: the comparison of a project, or of two sets of pictures.
- `limit.py`: the one limit; `difference.py`: the figures of a difference; `frame_comparison.py`: one frame;
  `file_pairs.py`: sets of pictures; `picture_file.py`: strict PNG reading.
- `outcome.py`: the outcomes, which are the record of a report, too.
- `report_folder.py`: writes a report; `page.py`: its page; `ci_files.py`: its files for CI; `report_source.py`: reads
  it, from a folder or a ZIP archive; `terminal_text.py`: the same for the terminal.
- `pytest_plugin.py`: the fixtures and options of pytest.
- `golden/`: `project.py` (golden.yaml), `record.py` (golden.json), `golden_folder.py` (changes it as a whole),
  `drawing.py` (draws a scene's frames), `changes.py` (changed keys), `value_text.py` (their values in
  words), `scene_comparison.py`, `merging.py` (new pictures), `update.py` (drawn ones), `acceptance.py` (those of a
  report).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
