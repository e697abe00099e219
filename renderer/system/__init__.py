"""Find the processors and the memory for this process, start child processes, lock files, and make text printable.

In: the machine, and text from outside. Out: numbers of processors and bytes, children that never outlive this process,
versions for records, text that is safe to print.

- `cores.py`: the processors that this process may use
- `memory.py`: the memory that is free for this process, and the peak of its use
- `child_processes.py`: children that end with their parent
- `file_locks.py`: locks of files, which keep other processes and threads out
- `interrupts.py`: Ctrl-C, SIGTERM and SIGHUP, deferred while files get their final names
- `overlapping.py`: work on one item while the next one is made
- `versions.py`: the versions of the packages and sources that make an output
- `printable_text.py`: text from outside, made safe to print
- `text_scanner.py`: numbers and attributes in text from outside
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
