from .executor import open_executor as open_executor
from .options import (
    ExecutorSpec as ExecutorSpec,
    executor_options as executor_options,
    memory_option as memory_option,
    require_executor as require_executor,
    require_executor_for as require_executor_for,
    workers_option as workers_option,
)
