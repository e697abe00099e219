"""What the terminal shows, and what the machine is.

In: counts, durations, steps of long work. Out: text and progress bars, in one place. Also interrupts, and versions and
hardware for sidecars.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
