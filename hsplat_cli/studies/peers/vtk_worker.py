"""Draw with VTK in a separate process: `python vtk_worker.py FOLDER`. Without FOLDER, print VTK's version and driver.

Imports nothing of hsplat; `hsplat_cli.studies.peers.vtk_peer` starts it. FOLDER holds

    job.json       the scene, in its own unit of length
    voxels.npy     [z, y, x], of a type that VTK draws without conversion

Each line on the standard input stream requests one frame, `{"setting": {...}, "camera": 0}`. The worker writes it to
`picture.npy`, uint8 [h, w, 3], row 0 at the top, and answers with the seconds of drawing it, `{"seconds": 0.5}`. It
does nothing between requests, and ends with them. The first frame of a setting compiles and uploads.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt
import vtkmodules.vtkRenderingOpenGL2
import vtkmodules.vtkRenderingVolumeOpenGL2  # noqa: F401  registers VTK's OpenGL classes
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkCommand, vtkLogger, vtkOutputWindow, vtkUnsignedCharArray, vtkVersion
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPiecewiseFunction
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkRenderingCore import (
    vtkColorTransferFunction,
    vtkRenderer,
    vtkRenderWindow,
    vtkVolume,
    vtkVolumeProperty,
)
from vtkmodules.vtkRenderingVolume import vtkFixedPointVolumeRayCastMapper
from vtkmodules.vtkRenderingVolumeOpenGL2 import vtkOpenGLGPUVolumeRayCastMapper

Json = dict[str, Any]


def main(folder: Path, requests: Iterable[str], answers: IO[str]) -> None:
    """Answer requests until they end."""
    job: Json = json.loads((folder / "job.json").read_text(encoding="utf-8"))
    image = _make_image(np.load(folder / "voxels.npy", allow_pickle=False), job["spacing"])
    volume_property = _make_property(job)
    current: Json | None = None
    window = renderer = None
    for line in requests:
        request = json.loads(line)
        if request["setting"] != current:
            if window is not None:
                window.Finalize()  # frees its memory on the device
            current = request["setting"]
            window, renderer = _make_window(
                job, _make_volume(job, volume_property, _make_mapper(request["setting"], image))
            )
        _set_camera(window, renderer, job["cameras"][request["camera"]])
        picture, seconds = _draw(window, renderer)
        np.save(folder / "picture.npy", picture, allow_pickle=False)
        print(json.dumps({"seconds": seconds}), file=answers, flush=True)


def describe() -> dict[str, str]:
    """Return VTK's version and the name of its GL renderer."""
    window = vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.Render()
    lines = [line.partition("OpenGL renderer string:")[2].strip() for line in window.ReportCapabilities().splitlines()]
    window.Finalize()
    return {"version": vtkVersion.GetVTKVersion(), "driver": "".join(lines) or "unknown"}


def _make_image(voxels: npt.NDArray[Any], spacing: list[float]) -> Any:
    image = vtkImageData()
    image.SetDimensions(voxels.shape[::-1])
    image.SetSpacing(spacing)
    image.GetPointData().SetScalars(numpy_to_vtk(voxels.ravel()))
    return image


def _make_property(job: Json) -> Any:
    """Return the transfer function, with opacities per unit of length."""
    color, opacity = vtkColorTransferFunction(), vtkPiecewiseFunction()
    for value, red, green, blue, alpha in job["points"]:
        color.AddRGBPoint(value, red, green, blue)
        opacity.AddPoint(value, alpha)
    volume_property = vtkVolumeProperty()
    volume_property.SetColor(color)
    volume_property.SetScalarOpacity(opacity)
    volume_property.SetScalarOpacityUnitDistance(1.0)
    volume_property.SetInterpolationTypeToLinear()
    volume_property.ShadeOff()
    return volume_property


def _make_mapper(setting: Json, image: Any) -> Any:
    """Return a mapper that does not adapt to the time of a frame, and adds no jitter."""
    kinds = {"gpu": vtkOpenGLGPUVolumeRayCastMapper, "fixed point": vtkFixedPointVolumeRayCastMapper}
    mapper: Any = kinds[setting["mapper"]]()
    if setting["mapper"] == "gpu":
        mapper.UseJitteringOff()
    mapper.AutoAdjustSampleDistancesOff()
    mapper.LockSampleDistanceToInputSpacingOff()
    mapper.SetSampleDistance(setting["sample_distance"])
    mapper.SetImageSampleDistance(setting["image_reduction"])
    mapper.SetInputData(image)
    return mapper


def _make_volume(job: Json, volume_property: Any, mapper: Any) -> Any:
    world_from_image = vtkMatrix4x4()
    world_from_image.DeepCopy([number for row in job["world_from_image"] for number in row])
    volume = vtkVolume()
    volume.SetMapper(mapper)
    volume.SetProperty(volume_property)
    volume.SetUserMatrix(world_from_image)
    return volume


def _make_window(job: Json, volume: Any) -> tuple[Any, Any]:
    renderer = vtkRenderer()
    renderer.AddVolume(volume)
    renderer.SetBackground(job["background"])
    window = vtkRenderWindow()
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.AddRenderer(renderer)
    return window, renderer


def _set_camera(window: Any, renderer: Any, view: Json) -> None:
    window.SetSize(view["size"])
    camera = renderer.GetActiveCamera()
    camera.SetPosition(view["eye"])
    camera.SetFocalPoint(view["focus"])
    camera.SetViewUp(view["up"])
    if "half_height" in view:
        camera.ParallelProjectionOn()
        camera.SetParallelScale(view["half_height"])
    else:
        camera.ParallelProjectionOff()
        camera.SetViewAngle(view["angle_deg"])
    camera.SetClippingRange(view["clipping"])


def _draw(window: Any, renderer: Any) -> tuple[npt.NDArray[np.uint8], float]:
    """Return the picture, and the seconds of drawing and reading it back."""
    width, height = window.GetSize()
    pixels = vtkUnsignedCharArray()
    renderer.GetActiveCamera().Modified()
    start = time.perf_counter()
    window.Render()
    # vtkWindowToImageFilter would draw the frame a second time.
    window.GetPixelData(0, 0, width - 1, height - 1, 0, pixels, 0)
    seconds = time.perf_counter() - start
    return vtk_to_numpy(pixels).reshape(height, width, 3)[::-1], seconds


def _fail_on_errors() -> None:
    """End the process on an error of VTK, which otherwise continues with a black picture; suppress warnings."""
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)

    def fail(_source: object, _event: str) -> None:
        sys.stderr.flush()
        os._exit(1)  # VTK's code would ignore an exception

    vtkOutputWindow.GetInstance().AddObserver(vtkCommand.ErrorEvent, fail)


if __name__ == "__main__":
    # Answers use a separate stream, because drivers print to the standard output stream.
    with open(os.dup(1), "w", encoding="utf-8") as stream:
        os.dup2(2, 1)
        _fail_on_errors()
        if len(sys.argv) > 1:
            main(Path(sys.argv[1]), sys.stdin, stream)
        else:
            print(json.dumps(describe()), file=stream)
