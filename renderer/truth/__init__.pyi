from .integrator import (
    Convergence as Convergence,
    converged_image as converged_image,
    integrate as integrate,
)
