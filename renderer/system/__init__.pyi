from .child_processes import (
    ChildProcesses as ChildProcesses,
    describe_exit as describe_exit,
    exit_with_parent as exit_with_parent,
    open_anonymous_file as open_anonymous_file,
)
from .cores import num_cores as num_cores
from .file_locks import is_path_of as is_path_of, lock_bytes as lock_bytes, unlock_bytes as unlock_bytes
from .interrupts import (
    ctrl_c_stops_kernels as ctrl_c_stops_kernels,
    deferrable_interrupts as deferrable_interrupts,
    exit_on_signals as exit_on_signals,
    interrupted_status as interrupted_status,
    result_of as result_of,
    signals_as_interrupts as signals_as_interrupts,
    start_threads as start_threads,
    stop_flag as stop_flag,
)
from .memory import (
    MemoryShare as MemoryShare,
    PeakMemory as PeakMemory,
    address_space_hint as address_space_hint,
    free_bytes as free_bytes,
    free_swap_bytes as free_swap_bytes,
)
from .overlapping import overlap as overlap
from .printable_text import PrintableText as PrintableText, join_lines as join_lines, printable as printable
from .text_scanner import (
    attribute as attribute,
    number_in as number_in,
    unescaped as unescaped,
    whole_number_in as whole_number_in,
)
from .versions import (
    MEASURING_PACKAGES as MEASURING_PACKAGES,
    commit as commit,
    package_versions as package_versions,
    sources_digest as sources_digest,
)

# isort: split
# For tests alone: steps and constants that no other room uses.
from .cores import control_groups as control_groups
