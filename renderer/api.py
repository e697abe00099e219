"""Define the Python API: pictures, films and exact pictures from a scene file, a Scene or a numpy array.

The API draws in this process, on all cores, to the same bytes as the command `hsplat render`.
"""

from __future__ import annotations

import base64
import html
import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from renderer.api_layers import ImageLike, Layer, TransferLike, VolumesLike
from renderer.api_scenes import (
    CameraLike,
    LightLike,
    SceneLike,
    argument_text,
    frame_number,
    frame_numbers,
    make_scene,
    scene_file,
)
from renderer.errors import InputError
from renderer.film import encode_png, frame_path
from renderer.frame import FilmStage, LODCostEstimator, prepare_stage, require_annotation
from renderer.job import (
    FilmJob,
    JobEvents,
    NotebookBar,
    OnProgress,
    ProgressEvents,
    draw_frames,
    make_film,
    make_plan,
    one_pass,
    open_local_executor,
)
from renderer.readers import is_volume_name
from renderer.record import FilmAccuracy, FilmVisibility, accuracy_text
from renderer.scene import (
    FilmScene,
    accuracy_of,
    format_of,
    load_scene as load_scene_file,
)
from renderer.system import ctrl_c_stops_kernels, num_cores, printable

# The output of a scene whose pictures are not written: it allows pictures of any size and background.
_ANY_PICTURE = "{frame}.png"


class FrameImage(np.ndarray[tuple[int, ...], np.dtype[np.uint8]]):  # from NumPy 2.5 on, npt.NDArray is no class
    """A picture: a uint8 array [height, width, 3 or 4] that notebooks display.

    It is a numpy array in every other respect: `image.shape`, `image[:100]`, `np.asarray(image)`. Row 0 is the top. The
    fourth channel, where the background is transparent, is straight alpha.
    """

    def _repr_png_(self) -> bytes | None:
        """Return the picture as the bytes of a PNG file; None for an array that is no picture, such as one channel."""
        is_picture = self.dtype == np.uint8 and self.ndim == 3 and self.shape[2] in (3, 4) and self.size > 0
        return encode_png(np.ascontiguousarray(self)) if is_picture else None


class ExactImage(np.ndarray[tuple[int, ...], np.dtype[np.float32]]):
    """An exact picture: a float32 array [height, width, 3], with colours from 0 to 1.

    It is a numpy array in every other respect.

    Attributes
    ----------
    standard_error: the root of the mean variance of its pixels, each the mean of a few rays or paths; NaN for arrays
        that are made from the picture.
    """

    standard_error: float = math.nan


@dataclass(frozen=True)
class Film:
    """A film that `render` wrote, which notebooks play.

    Attributes
    ----------
    path: the file, or the template of the numbered frames, such as `frames/{frame:04}.png`.
    frames: the numbers of the film's frames.
    sidecar: the JSON file beside the film, which records how the film was made and the cost of each frame.
    notes: remarks on the film, for example that nothing is in view; mostly empty.
    accuracy: the accuracy of the frames, measured by exact rays: `psnr` in decibels, its 95 % `interval`, the `worst`
        frame, and `file.psnr`, the PSNR after encoding; None if nothing was measured.
    visibility: the scalars that the frames show, measured by exact rays: `coverage`, the mean opacity, and `ranges` of
        scalars with `low`, `high` and their `share` of the visible scalars; None if nothing was measured.
    """

    path: Path
    frames: tuple[int, ...]
    sidecar: Path
    notes: tuple[str, ...] = ()
    accuracy: FilmAccuracy | None = None
    visibility: FilmVisibility | None = None

    def _repr_html_(self) -> str:
        """Return HTML that shows the film, or its first picture, with a caption."""
        first, kind = frame_path(self.path, self.frames[0]), format_of(self.path).media_type
        data = f"data:{kind};base64,{base64.b64encode(first.read_bytes()).decode()}"
        element = '<img src="{}">' if kind.startswith("image/") else '<video controls loop muted src="{}"></video>'
        count = f"{len(self.frames)} frame{'s' * (len(self.frames) != 1)}"
        exact = [] if self.accuracy is None else [accuracy_text(self.accuracy), _error_in_words(self.accuracy)]
        lines = [f"{self.path}: {count}; how it was made: {self.sidecar}", *exact, *self.notes]
        caption = "<br>".join(html.escape(printable(line)) for line in lines)
        return f"<figure>{element.format(data)}<figcaption>{caption}</figcaption></figure>"


def _error_in_words(accuracy: FilmAccuracy) -> str:
    """Return a sentence on the root of the mean squared error of what is in the file."""
    levels = 255 * 10 ** (-(accuracy.file or accuracy).psnr / 20)
    return f"measured by exact rays: colours are off by {levels:.2g} of 255 levels (root mean square)"


@dataclass(frozen=True)
class Page:
    """A page in one HTML file, which notebooks display. html: the content of the file."""

    html: str

    def _repr_html_(self) -> str:
        """Return HTML that shows the page, in an `iframe`."""
        content = html.escape(self.html)
        return f'<iframe sandbox="allow-scripts" srcdoc="{content}" width="100%" height="640"></iframe>'


def load_scene(path: str | os.PathLike[str], *, overrides: Sequence[str] = ()) -> FilmScene:
    """Read and check a scene file.

    Parameters
    ----------
    path: a YAML file; docs/scene.md lists its keys.
    overrides: changes such as `"error.tolerance=0.2"`, as for `--set` of the command.

    Returns the scene, a frozen dataclass: `dataclasses.replace` makes a changed scene.
    Raises SceneError, an InputError that lists all mistakes, line by line.

    Example
    -------
    >>> scene = renderer.load_scene("scene.yaml", overrides=["output.size=[256, 256]"])
    """
    is_list = isinstance(overrides, Sequence) and not isinstance(overrides, (str, bytes))
    if not is_list or not all(isinstance(each, str) for each in overrides):
        expected = 'a list of texts, such as ["error.tolerance=0.2"]'
        raise InputError("not a list of overrides", where="overrides", got=argument_text(overrides), expected=expected)
    return load_scene_file(scene_file(path), overrides=overrides)


@ctrl_c_stops_kernels()
def suggest_scene(
    volume: VolumesLike,
    *,
    labels: ImageLike | Layer | Mapping[Any, Any] | None = None,
    mask: ImageLike | Layer | None = None,
    spacing: Sequence[float] | None = None,
    transfer_function: TransferLike | None = None,
    light: LightLike | None = None,
    camera: CameraLike | None = None,
    size: tuple[int, int] | None = None,
    background: str | Sequence[float] | None = None,
    tolerance: float | None = None,
    output: str | os.PathLike[str] | None = None,
) -> FilmScene:
    """Make a scene that shows a volume, or several in one picture: a turntable, with looks that suit the values.

    Parameters
    ----------
    volume: an array [z, y, x] of integers, booleans or floats, which is never changed; an image of nibabel, ITK,
        SimpleITK or xarray, or a layer of napari, which has its own lengths and axes; or the name of a volume's file.
        Several in a list, or in a mapping from names, make one picture, in which the light of each has a colour of its
        own and adds up. A `Layer` gives a volume its own place and look: `Layer(array, labels={})` shows labels. An
        array without a place lies on the grid of the first volume.
    labels: a volume of labels that is drawn in the volume, whose surface becomes a translucent shell; several volumes
        keep the colours of channels, and are mixed. A `Layer` gives the labels names. Or, for a volume that is labels
        itself, a mapping from numbers to names, or the keys of `labels` in a scene file.
    mask: a volume of labels: the picture shows only what is inside of them; a `Layer` chooses some of the labels.
    spacing: lengths of a voxel along (x, y, z), in world units; by default 1, or the lengths of the image or the file.
    transfer_function: by default, a transfer function is suggested, as by `hsplat init`. Other values are the name of a
        colormap, for the colours of the suggestion; `{"preset": "bone"}`, with a preset of `hsplat init --preset`;
        control points `(value, color, opacity)`; or a mapping or a TransferSpec, as in a scene file. Opacities are per
        smallest spacing.
    light: light that matter scatters, in place of shading: studio, outdoor or overcast, as `hsplat init --light`
        suggests it for one volume; or a mapping, as in a scene file. It suits opaque matter, and takes longer.
    camera: a mapping or a CameraSpec, as in a scene file. Missing keys have the values of a turntable of 120 frames, 20
        degrees above the object, framed so that nothing is cut off.
    size: (width, height) of the pictures, in pixels; 512 x 512 by default.
    background: a colour; black by default. "transparent" needs a format that has alpha.
    tolerance: the error that is allowed; 0.1 by default. Smaller errors take more time; 0 draws every voxel.
    output: the file that `render` writes; film.mp4 by default.

    Returns the scene. Voxels that are NaN, infinite or have a fill value are left out.
    Raises InputError for an array or a file that is no volume, SceneError for parameters that a scene cannot have.

    Example
    -------
    >>> scene = renderer.suggest_scene(array, spacing=(0.5, 0.5, 1.2))
    >>> scene = renderer.suggest_scene({"nuclei": array, "membranes": array**2}, output="cells.mp4")
    """
    options: dict[str, Any] = {"labels": labels, "mask": mask, "spacing": spacing}
    options |= {"transfer_function": transfer_function, "light": light, "camera": camera}
    options |= {"size": size, "background": background, "tolerance": tolerance, "output": output}
    return make_scene(volume, options, is_volume=True)


@ctrl_c_stops_kernels()
def render_frame(
    scene: SceneLike,
    frame: int = 0,
    *,
    labels: ImageLike | Layer | Mapping[Any, Any] | None = None,
    mask: ImageLike | Layer | None = None,
    spacing: Sequence[float] | None = None,
    transfer_function: TransferLike | None = None,
    light: LightLike | None = None,
    camera: CameraLike | None = None,
    size: tuple[int, int] | None = None,
    background: str | Sequence[float] | None = None,
    tolerance: float | None = None,
) -> FrameImage:
    """Draw one frame, without writing a file.

    Parameters
    ----------
    scene: a Scene, the name of a scene file, or one or several volumes as in `suggest_scene`, for which a scene is
        suggested.
    frame: the number of the frame on the camera's path; -1 for the last frame.
    labels, mask, spacing, transfer_function, light, camera, size, background, tolerance: as in `suggest_scene`; they
        replace the values of a scene, in which `light` is a mapping.

    Returns the picture: a uint8 array [height, width, 3], or [height, width, 4] with straight alpha where the
    background is transparent. It has the bytes that `hsplat render` writes.
    Raises InputError, SceneError, and RenderError if a scene with splats finds no OpenGL.

    Example
    -------
    >>> image = renderer.render_frame(array, spacing=(1, 1, 2), background="white")
    >>> image = renderer.render_frame(array, labels=array > 100, mask=array > 20)
    >>> image = renderer.render_frame(array, light="studio")
    """
    options: dict[str, Any] = {"labels": labels, "mask": mask, "spacing": spacing}
    options |= {"transfer_function": transfer_function, "light": light, "camera": camera}
    # Nothing is written, so the picture may have an odd size or be transparent, whatever the scene's output allows.
    options |= {"size": size, "background": background, "tolerance": tolerance, "output": _ANY_PICTURE}
    made = make_scene(scene, options)
    numbers = [frame_number(frame, made)]
    with open_local_executor(made) as executor, _open_stage(made) as stage:
        require_annotation(stage, numbers)
        plan = make_plan(LODCostEstimator(stage), numbers, lambda: executor.rasterizer, JobEvents())
        # This import is not at the top of the file, because the ray integral takes a while to load.
        from renderer.accuracy import open_prober

        # The accuracy is measured only if there is annotation, which may show it.
        prober = open_prober(stage, num_cores()) if made.at(0).annotation.shows_anything else None
        (drawn,) = draw_frames(plan.stage, numbers, executor.rasterizer, plan.controller, prober, is_overlapped=False)
    image: FrameImage = drawn.pictures[0].pixels.view(FrameImage)
    return image


@ctrl_c_stops_kernels()
def render(
    scene: SceneLike,
    *,
    output: str | os.PathLike[str] | None = None,
    frames: int | slice | Sequence[int] | None = None,
    best_effort: bool = False,
    resume: bool = True,
    on_progress: OnProgress | None = None,
) -> Film:
    """Draw a film and write it with its sidecar, to the same bytes as the command `hsplat render`.

    The file is written whole or not at all, and it never replaces one of the scene's inputs. A film that is up to date
    is not drawn again, and one that was stopped, here or by the command, resumes where it stopped.

    Parameters
    ----------
    scene: a Scene, the name of a scene file, or one or several volumes as in `suggest_scene`, for which a scene is
        suggested.
    output: the only file to write, in place of the scene's outputs: film.mp4, film.webp and so on, a template such as
        `frames/{frame:04}.png` or, for one frame, a .png.
    frames: the frames to draw, ascending: `range(0, 30)`, `slice(None, None, 10)`, `-1`; all by default.
    best_effort: whether to accept a film that is less accurate than the scene asks for. A budget of seconds is kept as
        well as this machine can; frames that take longer are no error.
    resume: whether to keep the frames that an earlier job finished. Further outputs that hold other films are errors
        then. Without it, every frame is drawn, and such files are replaced, as with `--force`.
    on_progress: a function that is called as `on_progress(num_finished, num_frames)` after each frame that is drawn. An
        error that it raises ends the job, which can be resumed. By default, notebooks show a bar.

    Returns the Film, which notebooks play.
    Raises InputError, SceneError, OutputLockedError if another job is writing the same output, and RenderError if the
    film cannot be written or is less accurate than the scene asks for; the film is written in the latter case, too.

    Example
    -------
    >>> film = renderer.render("scene.yaml", output="draft.gif", frames=range(0, 120, 10))
    >>> film.path, film.sidecar
    """
    made = make_scene(scene, {"output": output}, is_single_frame=True)
    numbers = frame_numbers(frames, made)
    made = make_scene(made, {}, is_single_frame=len(numbers) == 1)
    is_file = isinstance(scene, (str, os.PathLike)) and not is_volume_name(scene)
    path = scene_file(scene) if is_file else None
    job = FilmJob(made, numbers, accuracy_of(made.error), path=path)
    events = NotebookBar() if on_progress is None else ProgressEvents(on_progress)
    result = make_film(job, open_local_executor, one_pass, events, resumes=resume)
    if result.shortfall is not None and not best_effort:
        raise result.shortfall
    notes = [result.volume_note] if result.volume_note else []
    record = result.film.record
    told = record.accuracy, record.visibility
    return Film(result.file, record.numbers, result.film.path, (*notes, *record.notes), *told)


@ctrl_c_stops_kernels()
def preview(scene: SceneLike) -> Page:
    """Return a page that shows a scene before its film is made, as `hsplat preview` does. Nothing is written.

    Parameters
    ----------
    scene: a Scene, the name of a scene file, or one or several volumes as in `suggest_scene`, for which a scene is
        suggested.

    Returns the page, which notebooks display; its `html` is the content of a single file.
    Raises InputError, SceneError, and RenderError if a scene with splats finds no OpenGL.

    Example
    -------
    >>> Path("page.html").write_text(renderer.preview(array).html, "utf-8")
    """
    from hsplat_cli.preview import preview_page

    made = make_scene(scene, {})
    title = f"Preview of {Path(scene).name if isinstance(scene, (str, os.PathLike)) else 'a scene'}"
    job = FilmJob(made, range(made.num_frames), accuracy_of(made.error))
    page, _ = preview_page(job, title, lambda _: None)
    return Page(page)


@ctrl_c_stops_kernels()
def integrate(
    scene: SceneLike,
    frame: int = 0,
    *,
    standard_error: float = 0.005,
    on_progress: Callable[[float], None] | None = None,
) -> ExactImage:
    """Compute the exact picture of a frame: the mean over each pixel of converged ray integrals, without cells.

    With `light`, the mean is taken over paths of light, without the grid on which a film's light is found. This takes
    far longer than drawing: use small pictures.

    Parameters
    ----------
    scene: a Scene, the name of a scene file, or one or several volumes as in `suggest_scene`, for which a scene is
        suggested.
    frame: the number of the frame on the camera's path; -1 for the last frame.
    standard_error: with `light`, the wanted standard error of a pixel. Half of it takes four times as long.
    on_progress: a function that is called with the finished share, from 0 to 1.

    Returns the ExactImage, over the scene's background, or over black if it is transparent, with its standard error.
    Without `light`, smooth pixels are within about 1e-4 of the truth. Where edges cross a pixel, up to 128 rays have an
    error of their own: pictures of scans have 63 to 69 dB against more rays.
    Raises InputError, SceneError, and RenderError if the integral does not converge.

    Example
    -------
    >>> error = renderer.render_frame(scene) / 255 - renderer.integrate(scene)
    >>> psnr = -10 * np.log10(np.mean(error**2))
    """
    from renderer.accuracy import TRUTH_TOLERANCE, compute_truth

    if not standard_error > 0:
        raise InputError("the standard error is not positive", where="standard_error", got=f"{standard_error}")
    made = make_scene(scene, {"output": _ANY_PICTURE})
    number = frame_number(frame, made)
    with _open_stage(made) as stage:
        truth = compute_truth(
            stage,
            number,
            TRUTH_TOLERANCE,
            standard_error=standard_error,
            num_threads=num_cores(),
            on_progress=on_progress or (lambda _: None),
        )
    image: ExactImage = truth.picture.astype(np.float32).view(ExactImage)
    image.standard_error = truth.standard_error
    return image


def _open_stage(scene: FilmScene) -> FilmStage:
    return prepare_stage(scene, clock=perf_counter, num_threads=num_cores())
