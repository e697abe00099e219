from .comparison import (
    COMPARISON_METRICS as COMPARISON_METRICS,
    FrameDifference as FrameDifference,
)
from .pareto import (
    Cost as Cost,
    cost_at_psnr as cost_at_psnr,
    pareto_front as pareto_front,
)
from .strictness import (
    STRICTNESSES as STRICTNESSES,
    Limits as Limits,
    exceeded_limits as exceeded_limits,
    severity as severity,
)
from .sweep import (
    FRAME_STEPS as FRAME_STEPS,
    FrameMeasurement as FrameMeasurement,
    Measurement as Measurement,
    PlannedSetting as PlannedSetting,
    Setting as Setting,
    Study as Study,
    Truths as Truths,
    measure_setting as measure_setting,
    plan_sweep as plan_sweep,
    splat_setting as splat_setting,
)
from .thumbnails import (
    DIFFERENCE_GAIN as DIFFERENCE_GAIN,
    amplified_difference as amplified_difference,
    rounded as rounded,
    thumbnail as thumbnail,
)
