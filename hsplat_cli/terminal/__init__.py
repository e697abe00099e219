"""Prints results and progress, and reads values of the command line.

Only the `Reporter` prints: results, lines, notes and progress. A command makes one and hands it down. The other files
turn durations, frame ranges and output paths of the command line into values, and describe the machine for reports.

- `reporter.py`: the `Reporter`; `progress_bar.py`: progress and the time that remains.
- `film_events.py`: prints the progress and the result of a film job.
- `arguments.py`: groups of options, output paths, `--frames A:B`, `90s`.
- `machine.py`: the machine and its versions.
- `shell_completion.py`: the words that a shell completes command lines with.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
