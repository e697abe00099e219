"""Find the OpenGL that draws splats, in a process of its own, because a driver may crash or hang."""

from __future__ import annotations

import json
import os
import subprocess

from renderer.errors import RenderError, require_package
from renderer.system import ChildProcesses, describe_exit

# The seconds after which a driver counts as hanging. Mesa's software renderer answers in 0.3 s.
_PATIENCE = 20.0


def describe_opengl() -> str:
    """Return the names of the OpenGL device and driver that draw splats.

    Raises RenderError if there are none, and InputError if the package that calls OpenGL is not installed.
    """
    require_package("moderngl", extra="splats")
    with ChildProcesses() as children:
        asked = children.start(__name__, [], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        with asked:
            try:
                answer, _ = asked.communicate(timeout=_PATIENCE)
            except subprocess.TimeoutExpired:
                asked.kill()
                raise RenderError("OpenGL does not answer", got=f"nothing in {_PATIENCE:g} s") from None
    if not answer:
        raise RenderError("OpenGL ended its process", got=describe_exit(asked.returncode))
    told = json.loads(answer)
    if "device" in told:
        return str(told["device"])
    raise RenderError(told["what"], got=told["got"], hint=told["hint"])


def _main() -> None:
    """Write the device, or the error, as JSON to the standard output, as the child process."""
    from renderer.draw.splats.splat_rasterizer import SplatRasterizer

    try:
        with SplatRasterizer() as rasterizer:
            told = {"device": rasterizer.device}
    except RenderError as error:
        told = {"what": error.what, "got": error.got or "", "hint": error.hint or ""}
    os.write(1, json.dumps(told).encode())


if __name__ == "__main__":
    _main()
