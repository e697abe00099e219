from .frame_difference import (
    COMPARISON_METRICS as COMPARISON_METRICS,
    Figure as Figure,
    FrameDifference as FrameDifference,
)
from .metrics import (
    METRICS as METRICS,
    SSIM_WINDOW_PX as SSIM_WINDOW_PX,
    Accuracy as Accuracy,
    Metric as Metric,
    Picture as Picture,
    compare as compare,
    over_background as over_background,
    pool_accuracies as pool_accuracies,
    require_measuring_packages as require_measuring_packages,
    single as single,
)
from .pareto import cost_at_psnr as cost_at_psnr, pareto_front as pareto_front, setbacks as setbacks
from .results import Study as Study, TruthRecord as TruthRecord
from .strictness import LEVELS as LEVELS, Limits as Limits, exceeded as exceeded, severity as severity
from .sweep import (
    FRAME_STAGES as FRAME_STAGES,
    Measurement as Measurement,
    Sample as Sample,
    Setting as Setting,
    measure_setting as measure_setting,
    pyramid_seconds as pyramid_seconds,
    splat_setting as splat_setting,
)
from .sweep_plan import PlannedSetting as PlannedSetting, plan_sweep as plan_sweep
from .thumbnails import (
    DIFFERENCE_GAIN as DIFFERENCE_GAIN,
    difference_picture as difference_picture,
    difference_thumbnail as difference_thumbnail,
    thumbnail as thumbnail,
)
from .trials import Found as Found, Trial as Trial, TruthOf as TruthOf, find_tolerance as find_tolerance
from .truths import (
    TRUTH_TOLERANCE as TRUTH_TOLERANCE,
    Truth as Truth,
    TruthCache as TruthCache,
    compute_truth as compute_truth,
    is_loop as is_loop,
    spread_frames as spread_frames,
)
