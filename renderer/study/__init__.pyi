from .comparison import (
    COMPARISON_METRICS as COMPARISON_METRICS,
    FrameDifference as FrameDifference,
)
from .film_tolerances import (
    FilmTolerances as FilmTolerances,
    find_film_tolerances as find_film_tolerances,
)
from .metrics import (
    METRICS as METRICS,
    SSIM_WINDOW_PX as SSIM_WINDOW_PX,
    Accuracy as Accuracy,
    FloatImage as FloatImage,
    Metric as Metric,
    SampledAccuracy as SampledAccuracy,
    compute_metric as compute_metric,
    measure_accuracy as measure_accuracy,
    pool_accuracies as pool_accuracies,
    require_measuring_packages as require_measuring_packages,
    sampled_accuracy as sampled_accuracy,
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
    FirstPass as FirstPass,
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
from .tolerance_search import (
    ToleranceSearchResult as ToleranceSearchResult,
    Trial as Trial,
    find_tolerance as find_tolerance,
)
from .truths import (
    NUM_SAMPLED_PIXELS as NUM_SAMPLED_PIXELS,
    TRUTH_TOLERANCE as TRUTH_TOLERANCE,
    SampledTruth as SampledTruth,
    Truth as Truth,
    compute_truth as compute_truth,
    is_loop as is_loop,
    sample_truths as sample_truths,
    spread_evenly as spread_evenly,
)
