"""Open the rasteriser of a scene."""

from __future__ import annotations

from renderer.draw.rasterizer import Rasterizer
from renderer.errors import require_package
from renderer.scene import FilmScene
from renderer.system import MemoryShare, num_cores


def open_rasterizer(scene: FilmScene, memory: MemoryShare | None = None) -> Rasterizer:
    """Open the rasteriser of a scene's footprint. Raises RenderError if it needs OpenGL and there is none.

    Raises InputError if the package that calls OpenGL is not installed.

    memory: the memory for bricks, by default half of the free memory; pictures do not depend on it.
    """
    # The import is here because bricks need no OpenGL.
    if scene.needs_opengl:
        require_package("moderngl", extra="splats")
        from renderer.draw.splats.recovery import RecoveringRasterizer

        return RecoveringRasterizer()
    from renderer.draw.bricks.brick_rasterizer import BrickRasterizer

    return BrickRasterizer(num_threads=num_cores(), memory=memory)
