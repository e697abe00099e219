from .integrator import (
    Convergence as Convergence,
    Progress as Progress,
    converged_image as converged_image,
    integrate as integrate,
)
