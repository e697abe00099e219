from .executor import Executor as Executor, open_executor as open_executor
from .frame_result import FrameExecutor as FrameExecutor, FrameResult as FrameResult, LocalExecutor as LocalExecutor
from .options import (
    ExecutorSpec as ExecutorSpec,
    executor_options as executor_options,
    require_executor as require_executor,
    require_executor_for as require_executor_for,
    workers_option as workers_option,
)
from .rasterizers import open_rasterizer as open_rasterizer
from .workers.child_processes import ChildProcesses as ChildProcesses, describe_exit as describe_exit
