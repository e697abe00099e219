from .decibels import (
    MOST_DB as MOST_DB,
    ROUNDING_ERROR as ROUNDING_ERROR,
    psnr as psnr,
    squared_error as squared_error,
    wanted_error as wanted_error,
)
from .encoding import (
    EncodingErrors as EncodingErrors,
    asked_psnr as asked_psnr,
    encoding_loss as encoding_loss,
    finer_drawing as finer_drawing,
    finer_encoding as finer_encoding,
    finer_than_kept as finer_than_kept,
    typical_kept_psnr as typical_kept_psnr,
    typical_psnr as typical_psnr,
)
from .estimate import (
    DEVIATIONS as DEVIATIONS,
    ErrorSamples as ErrorSamples,
    error_samples as error_samples,
    pool_samples as pool_samples,
)
from .file_errors import measure_encoding as measure_encoding
from .flicker import (
    LEVELS as LEVELS,
    Flicker as Flicker,
    PictureErrors as PictureErrors,
    measure_flicker as measure_flicker,
    pool_flickers as pool_flickers,
)
from .glance import (
    NOTHING as NOTHING,
    NOTHING_VISIBLE as NOTHING_VISIBLE,
    Glance as Glance,
    look_ahead as look_ahead,
    look_at_scene as look_at_scene,
)
from .metrics import (
    METRICS as METRICS,
    REACH_PX as REACH_PX,
    SSIM_WINDOW_PX as SSIM_WINDOW_PX,
    Accuracy as Accuracy,
    FloatImage as FloatImage,
    Metric as Metric,
    compute_metric as compute_metric,
    metric_map as metric_map,
    pool_accuracies as pool_accuracies,
    require_measuring_packages as require_measuring_packages,
)
from .pixels import choose_pixels as choose_pixels
from .prober import (
    ExactPixels as ExactPixels,
    FrameProber as FrameProber,
    Probe as Probe,
    open_prober as open_prober,
)
from .references import (
    ExactPictures as ExactPictures,
    ExactRays as ExactRays,
    Reference as Reference,
)
from .search import (
    FoundTolerances as FoundTolerances,
    Trial as Trial,
    find_tolerances as find_tolerances,
)
from .shared_probes import (
    SharedErrors as SharedErrors,
    error_products as error_products,
    estimate_flicker as estimate_flicker,
)
from .tolerances import spread_tolerances as spread_tolerances
from .truths import (
    NUM_SAMPLED_PIXELS as NUM_SAMPLED_PIXELS,
    TRUTH_TOLERANCE as TRUTH_TOLERANCE,
    SampledTruth as SampledTruth,
    Truth as Truth,
    compute_truth as compute_truth,
    is_loop as is_loop,
    sample_truths as sample_truths,
    spread_evenly as spread_evenly,
    with_a_neighbour as with_a_neighbour,
)
from .visibility import ScalarRange as ScalarRange, scalar_ranges as scalar_ranges

# isort: split
# For tests alone: steps and constants that no other room uses.
from .metrics import (
    measure_accuracy as measure_accuracy,
    sampled_accuracy as sampled_accuracy,
)
from .shared_probes import first_of_pair as first_of_pair, shared_pixels as shared_pixels
from .tolerances import (
    distinct_tolerances as distinct_tolerances,
    tolerance_ladder as tolerance_ladder,
)
from .visibility import visible_ranges as visible_ranges
