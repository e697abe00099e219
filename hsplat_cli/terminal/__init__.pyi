from .arguments import (
    Command as Command,
    OutputPath as OutputPath,
    VolumePath as VolumePath,
    is_one_frame as is_one_frame,
    option_group as option_group,
    packed_options as packed_options,
    parse_bytes as parse_bytes,
    parse_duration as parse_duration,
    parse_frames as parse_frames,
    set_hint as set_hint,
)
from .film_events import FilmEvents as FilmEvents, report_film as report_film
from .machine import Machine as Machine, describe_machine as describe_machine
from .reporter import Reporter as Reporter, format_table as format_table
from .shell_completion import (
    COMPLETION_VARIABLE as COMPLETION_VARIABLE,
    SHELLS as SHELLS,
    completion_script as completion_script,
    next_words as next_words,
)

# isort: split
# For tests alone: steps and constants that no other room uses.
from .progress_bar import PassProgress as PassProgress, Progress as Progress
