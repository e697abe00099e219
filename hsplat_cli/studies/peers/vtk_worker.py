"""Draws with VTK, in a process of its own: `python vtk_worker.py FOLDER`; without FOLDER it tells what VTK that is.

Imports nothing of hsplat; `hsplat_cli.studies.peers.vtk_peer` is the other side. FOLDER holds

    job.json       the scene, lengths in a unit of its own
    voxels.npy     [z, y, x], of a type that VTK draws as it is

Each line on the standard input stream orders one frame, `{"setting": {...}, "camera": 0}`. It is written to
`picture.npy`, uint8 [h, w, 3], row 0 at the top, and answered by `{"seconds": 0.5}`, those of drawing it. Between the
orders nothing runs here, and when they end so does the process. The first frame of a setting compiles and uploads.
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
import vtkmodules.vtkRenderingVolumeOpenGL2  # noqa: F401  imported so that VTK finds its OpenGL classes
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
    """Draw what is ordered."""
    job: Json = json.loads((folder / "job.json").read_text(encoding="utf-8"))
    image = _make_image(np.load(folder / "voxels.npy", allow_pickle=False), job["spacing"])
    volume_property = _make_property(job)
    current: Json | None = None
    window = renderer = None
    for line in requests:
        request = json.loads(line)
        if request["setting"] != current:
            if window is not None:
                window.Finalize()  # gives its memory on the device back
            current = request["setting"]
            window, renderer = _make_window(
                job, _make_volume(job, volume_property, _make_mapper(request["setting"], image))
            )
        _set_camera(window, renderer, job["cameras"][request["camera"]])
        picture, seconds = _draw(window, renderer)
        np.save(folder / "picture.npy", picture, allow_pickle=False)
        print(json.dumps({"seconds": seconds}), file=answers, flush=True)


def describe() -> dict[str, str]:
    """VTK's version, and the GL renderer that its windows are drawn with."""
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
    """The transfer function; opacities are per unit of length."""
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
    """Nothing adapts itself to the time that a frame takes, and no noise hides the steps."""
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
    """The picture, and the seconds that it took to draw it and to read it back."""
    width, height = window.GetSize()
    pixels = vtkUnsignedCharArray()
    renderer.GetActiveCamera().Modified()
    start = time.perf_counter()
    window.Render()
    # Not by vtkWindowToImageFilter, which would draw the frame a second time.
    window.GetPixelData(0, 0, width - 1, height - 1, 0, pixels, 0)
    seconds = time.perf_counter() - start
    return vtk_to_numpy(pixels).reshape(height, width, 3)[::-1], seconds


def _fail_on_errors() -> None:
    """VTK writes down what goes wrong and goes on with a black picture: here that is the end, and no warning is heard,
    as that there is no screen."""
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)

    def fail(_source: object, _event: str) -> None:
        sys.stderr.flush()
        os._exit(1)  # an exception would end in VTK's own code, which ignores it

    vtkOutputWindow.GetInstance().AddObserver(vtkCommand.ErrorEvent, fail)


if __name__ == "__main__":
    # The answers get a stream that nothing else writes to: drivers like to print.
    with open(os.dup(1), "w", encoding="utf-8") as stream:
        os.dup2(2, 1)
        _fail_on_errors()
        if len(sys.argv) > 1:
            main(Path(sys.argv[1]), sys.stdin, stream)
        else:
            print(json.dumps(describe()), file=stream)
