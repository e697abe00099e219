"""Draw with VTK, in a process of its own that `tests/bench/vtk_peer.py` starts; imports nothing of hsplat.

`begin` takes the scene in its own unit of length, and voxels [z, y, x] of a type that VTK draws without conversion.
`draw` takes a setting and the number of a camera; the first frame of a setting compiles and uploads.
"""

from __future__ import annotations

import os
import sys
import time
from typing import Any

import numpy as np
import numpy.typing as npt
import vtkmodules.vtkRenderingOpenGL2
import vtkmodules.vtkRenderingVolumeOpenGL2  # noqa: F401  registers VTK's OpenGL classes
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkCommand, vtkLogger, vtkOutputWindow, vtkUnsignedCharArray, vtkVersion
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkPiecewiseFunction
from vtkmodules.vtkCommonMath import vtkMatrix4x4
from vtkmodules.vtkRenderingCore import (
    vtkCamera,
    vtkColorTransferFunction,
    vtkLight,
    vtkRenderer,
    vtkRenderWindow,
    vtkVolume,
    vtkVolumeProperty,
)
from vtkmodules.vtkRenderingVolume import vtkFixedPointVolumeRayCastMapper, vtkVolumeMapper
from vtkmodules.vtkRenderingVolumeOpenGL2 import vtkOpenGLGPUVolumeRayCastMapper

Json = dict[str, Any]
Picture = npt.NDArray[np.uint8] | npt.NDArray[np.float32]


class _Painter:
    """A scene that VTK draws: one setting at a time has a window."""

    def __init__(self, job: Json, voxels: npt.NDArray[Any]) -> None:
        self._job, self._voxels = job, voxels  # VTK's image refers to the voxels
        self._image = _make_image(voxels, job["spacing"])
        self._setting: Json = {}
        self._window: Any = None
        self._renderer: Any = None

    def draw(self, setting: Json, camera: int) -> tuple[Picture, float]:
        """Draw a frame; return the picture, and the seconds."""
        job = self._job
        if setting != self._setting:
            if self._window is not None:
                self._window.Finalize()  # frees its memory on the device
            self._setting = setting
            mapper = _make_mapper(setting, self._image, job)
            self._window, self._renderer = _make_window(job, _make_property(setting, job), mapper)
        width, height = job["cameras"][camera]["size"]
        across = max(1, int(setting["rays_across"]))
        self._window.SetSize(width * across, height * across)
        self._renderer.SetActiveCamera(vtkCamera(**job["cameras"][camera]["camera"]))
        return _draw(self._window, self._renderer, across)


_painters: list[_Painter] = []


def begin(*scene: Any) -> None:
    """Prepare the process, and a job and its voxels if they are given."""
    _fail_on_errors()
    if scene:
        _painters.append(_Painter(*scene))


def draw(setting: Json, camera: int) -> tuple[Picture, float]:
    """Return the picture, [h, w, 3] from 0 to 255, row 0 at the top, and the seconds of drawing and reading it back."""
    return _painters[0].draw(setting, camera)


def describe() -> dict[str, str]:
    """Return VTK's version and the name of its GL renderer."""
    window = vtkRenderWindow(off_screen_rendering=True)
    window.Render()
    lines = [line.partition("OpenGL renderer string:")[2].strip() for line in window.ReportCapabilities().splitlines()]
    window.Finalize()
    return {"version": vtkVersion.GetVTKVersion(), "device": "".join(lines) or "unknown"}


def _make_image(voxels: npt.NDArray[Any], spacing: list[float]) -> Any:
    image = vtkImageData(dimensions=voxels.shape[::-1], spacing=spacing)
    image.GetPointData().SetScalars(numpy_to_vtk(voxels.ravel()))
    return image


def _make_property(setting: Json, job: Json) -> Any:
    """Return the transfer function, with opacities per unit of length, and the material.

    Where light comes from the viewer, at an angle t to the normal, the highlight of the fixed-point mapper is
    cos(t)^power. That of the GPU mapper is cos(2 t)^power, for small t the same as cos(t)^(4 power).
    """
    color, opacity = vtkColorTransferFunction(), vtkPiecewiseFunction()
    for value, red, green, blue, alpha in job["points"]:
        color.AddRGBPoint(value, red, green, blue)
        opacity.AddPoint(value, alpha)
    material: Json = {}
    if light := job["light"]:
        material = {"shade": True, **{key: light[key] for key in ("ambient", "diffuse", "specular")}}
        material["specular_power"] = light["shininess"] / (4 if setting["mapper"] == "gpu" else 1)
    volume_property: Any = vtkVolumeProperty(scalar_opacity_unit_distance=1.0, **material)
    volume_property.SetColor(color)
    volume_property.SetScalarOpacity(opacity)
    volume_property.SetInterpolationTypeToLinear()
    return volume_property


def _make_mapper(setting: Json, image: Any, job: Json) -> Any:
    """Return a mapper that does not adapt to the time of a frame, and adds no jitter."""
    kinds = {"gpu": vtkOpenGLGPUVolumeRayCastMapper, "fixed point": vtkFixedPointVolumeRayCastMapper}
    options: Json = {"use_jittering": False} if setting["mapper"] == "gpu" else {}
    if job["window"]:
        options["final_color_window"], options["final_color_level"] = job["window"]
    mapper: Any = kinds[setting["mapper"]](
        auto_adjust_sample_distances=False,
        lock_sample_distance_to_input_spacing=False,
        sample_distance=setting["sample_distance"],
        image_sample_distance=max(1.0, 1.0 / setting["rays_across"]),
        blend_mode=getattr(vtkVolumeMapper, job["blend"]),
        **options,
    )
    mapper.SetInputData(image)
    return mapper


def _make_window(job: Json, volume_property: Any, mapper: Any) -> tuple[Any, Any]:
    world_from_image = vtkMatrix4x4()
    world_from_image.DeepCopy([number for row in job["world_from_image"] for number in row])
    renderer = vtkRenderer(background=job["background"])
    renderer.AddVolume(vtkVolume(mapper=mapper, property=volume_property, user_matrix=world_from_image))
    if job["light"]:
        renderer.SetTwoSidedLighting(job["light"]["two_sided"])
        headlight = vtkLight(ambient_color=(1, 1, 1))  # by default the fixed-point mapper leaves the ambient part out
        headlight.SetLightTypeToHeadlight()
        renderer.AddLight(headlight)
    window = vtkRenderWindow(off_screen_rendering=True, multi_samples=0)
    window.AddRenderer(renderer)
    return window, renderer


def _draw(window: Any, renderer: Any, across: int) -> tuple[Picture, float]:
    """Return the picture, and the seconds of drawing and reading it back.

    across: the window's pixels along a side of a pixel of the picture, which is their mean.
    """
    width, height = window.GetSize()
    pixels = vtkUnsignedCharArray()
    renderer.GetActiveCamera().Modified()
    start = time.perf_counter()
    window.Render()
    # vtkWindowToImageFilter would draw the frame a second time.
    window.GetPixelData(0, 0, width - 1, height - 1, 0, pixels, 0)
    picture: Picture = vtk_to_numpy(pixels).reshape(height, width, 3)[::-1]
    if across > 1:
        picture = _averaged(picture, across)
    return picture, time.perf_counter() - start


def _averaged(picture: Picture, across: int) -> npt.NDArray[np.float32]:
    """Return the mean of each square of across x across pixels.

    For 2048 x 2048 pixels this takes 6 ms of a processor, and `reshape` with `mean` 66 ms. It is 0.2 to 0.6 % of the
    time of a frame.
    """
    rows: Any = sum(picture[k::across].astype(np.uint16) for k in range(across))
    return sum(rows[:, k::across] for k in range(across)) / np.float32(across**2)


def _fail_on_errors() -> None:
    """End the process on an error of VTK, which otherwise continues with a black picture; suppress warnings."""
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)

    def fail(_source: object, _event: str) -> None:
        sys.stderr.flush()
        os._exit(1)  # VTK's code would ignore an exception

    vtkOutputWindow.GetInstance().AddObserver(vtkCommand.ErrorEvent, fail)
