from .integrator import (
    Convergence as Convergence,
    RayIntegrator as RayIntegrator,
    converged_image as converged_image,
    integrate as integrate,
)
