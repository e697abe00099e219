from .click_options import OutputPath as OutputPath, option_group as option_group
from .counts import counted as counted, first_few as first_few, pluralize_range as pluralize_range
from .duration import parse_duration as parse_duration
from .frame_range import is_one_frame as is_one_frame, parse_frames as parse_frames
from .interrupts import (
    deferrable_interrupts as deferrable_interrupts,
    sigterm_as_interrupt as sigterm_as_interrupt,
)
from .machine import PeakMemory as PeakMemory, describe_machine as describe_machine
from .reporter import Reporter as Reporter, format_table as format_table
