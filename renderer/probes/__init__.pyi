from .estimate import (
    ErrorSamples as ErrorSamples,
    error_samples as error_samples,
    pool_samples as pool_samples,
    psnr as psnr,
)
from .pixels import ChosenPixels as ChosenPixels, choose_pixels as choose_pixels
from .prober import (
    ExactPixels as ExactPixels,
    FrameProber as FrameProber,
    Probe as Probe,
    num_probe_rays as num_probe_rays,
)
from .visibility import scalar_ranges as scalar_ranges
