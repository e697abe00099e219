"""A film as PyVista makes it: `python pyvista_turntable.py JOB.json FILM.mp4`, or STILL.npy for its first frame.

Imports nothing of hsplat; `turntable_peer.py` is the other side. JOB.json has the volume's file, the transfer function,
the cameras of all frames, the mapper with its sample distance and image reduction, size and frame rate.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyvista


def main(job: dict[str, Any], output: Path) -> None:
    """Draw the film, or the first frame as uint8 [h, w, 3]."""
    plotter = pyvista.Plotter(off_screen=True, window_size=job["size"])
    plotter.set_background("black")
    plotter.render_window.SetMultiSamples(0)
    volume = plotter.add_volume(pyvista.read(job["volume"]), mapper=job["mapper"], show_scalar_bar=False)
    shape(volume, job)
    if output.suffix == ".npy":
        aim(plotter, job["cameras"][0], job["angle_deg"])
        plotter.show(auto_close=False)
        np.save(output, plotter.screenshot(return_img=True))
        return
    plotter.open_movie(str(output), framerate=job["frames_per_second"], quality=8)
    for camera in job["cameras"]:
        aim(plotter, camera, job["angle_deg"])
        plotter.write_frame()
    plotter.close()


def shape(volume: Any, job: dict[str, Any]) -> None:
    """Transfer function, and how finely rays are sampled."""
    color, opacity = volume.prop.GetRGBTransferFunction(), volume.prop.GetScalarOpacity()
    color.RemoveAllPoints()
    opacity.RemoveAllPoints()
    for value, red, green, blue, alpha in job["points"]:
        color.AddRGBPoint(value, red, green, blue)
        opacity.AddPoint(value, alpha)
    volume.prop.SetScalarOpacityUnitDistance(1.0)
    volume.prop.SetInterpolationTypeToLinear()
    volume.prop.ShadeOff()
    mapper = volume.mapper
    if hasattr(mapper, "UseJitteringOff"):
        mapper.UseJitteringOff()
    mapper.AutoAdjustSampleDistancesOff()
    mapper.LockSampleDistanceToInputSpacingOff()
    mapper.SetSampleDistance(job["sample_distance"])
    mapper.SetImageSampleDistance(job["image_reduction"])


def aim(plotter: Any, camera: dict[str, Any], angle_deg: float) -> None:
    """See from where the film is."""
    plotter.camera_position = [camera["eye"], camera["target"], camera["up"]]
    plotter.camera.view_angle = angle_deg
    plotter.renderer.ResetCameraClippingRange()


if __name__ == "__main__":
    main(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8")), Path(sys.argv[2]))
