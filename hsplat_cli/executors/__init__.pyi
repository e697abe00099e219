from .drawing_options import (
    ExecutorSpec as ExecutorSpec,
    executor_options as executor_options,
    memory_option as memory_option,
    require_scheduler as require_scheduler,
    require_untimed as require_untimed,
)
from .scheduler import open_executor as open_executor
