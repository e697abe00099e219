from .executor import Executor as Executor, FrameExecutor as FrameExecutor, open_executor as open_executor
from .frame_result import FrameResult as FrameResult, draw_locally as draw_locally
from .options import (
    ExecutorSpec as ExecutorSpec,
    executor_options as executor_options,
    require_executor as require_executor,
    require_executor_for as require_executor_for,
    workers_option as workers_option,
)
