"""What this process has and may use: processors, memory, child processes, versions; and text that is safe to print.

In: nothing but the machine. Out: numbers of the machine, children that never outlive this process, versions for
records.

- `cores.py`: processors that this process may use; `memory.py`: memory that is left for it, and the most that it has
  held.
- `child_processes.py`: children that end with their parent.
- `interrupts.py`: Ctrl-C, SIGTERM and SIGHUP, which wait while files get their final names.
- `overlapping.py`: work on one item while the next one is made.
- `versions.py`: versions of what made an output.
- `printable_text.py`: text from outside, made safe to print; `text_scanner.py`: numbers and attributes in such text.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
