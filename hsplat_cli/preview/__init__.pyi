from .live_page import file_states as file_states, served_states as served_states
from .page import NUM_PARTS as NUM_PARTS, preview_page as preview_page
from .watch import watch as watch

# isort: split
# For tests alone: steps and constants that no other room uses.
from .watch import State as State
