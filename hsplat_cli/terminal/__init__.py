"""Prints, and reads values of the command line.

`Reporter` is the one thing that prints: results, lines, notes and progress; a command makes one and hands it down. The
rest turns durations, frame ranges and output paths of the command line into values, and describes the machine for
reports.

- `reporter.py`: the `Reporter`; `progress_bar.py`: progress and the time that remains.
- `film_events.py`: prints what a film job tells.
- `arguments.py`: groups of options, output paths, `--frames A:B`, `90s`.
- `machine.py`: the machine and its versions.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
