"""Prints, and reads values of the command line.

`Reporter` is the one thing that prints: results, lines, notes and progress; a command makes one and hands it down. The
rest turns counts into text, and durations, frame ranges and output paths of the command line into values. Also:
interrupts, and the machine's hardware and memory for reports.

- `reporter.py`: the `Reporter`; `progress_bar.py`: progress and the time that remains.
- `click_options.py`: types of options; `frame_range.py`: `--frames A:B`; `duration.py`: `90s`; `counts.py`: counts and
  lists in words.
- `interrupts.py`: Ctrl-C and SIGTERM; `machine.py`: the machine, its memory and versions.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
