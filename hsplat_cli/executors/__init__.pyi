from .drawing_options import (
    ExecutorSpec as ExecutorSpec,
    executor_options as executor_options,
    memory_option as memory_option,
    require_scheduler as require_scheduler,
    require_untimed as require_untimed,
)
from .scheduler import open_executor as open_executor

# isort: split
# For tests alone: steps and constants that no other room uses.
from .cluster.cluster_drawing import ClusterDrawing as ClusterDrawing, draw_ahead as draw_ahead
from .cluster.connection import connect as connect
from .cluster.registry import WorkerRegistry as WorkerRegistry
from .cluster.worker import (
    describe_worker as describe_worker,
    draw_on_worker as draw_on_worker,
)
