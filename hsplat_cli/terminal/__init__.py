"""Prints, and reads what is typed.

`Reporter` is the one thing that prints: results, lines, notes and progress; a command makes one and hands it down. The
rest turns counts into text, and durations, frame ranges and output paths of the command line into values. Also:
interrupts, and the machine's hardware and memory for reports.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
