"""Define the Python API: pictures, films and exact pictures from a scene file, a scene or a numpy array.

The API draws in this process, on all cores, to the same bytes as the command `hsplat render`.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from renderer.api_layers import ImageLike, Layer, TransferLike, VolumesLike
from renderer.api_results import ExactImage, Film, FrameImage, Page
from renderer.api_scenes import (
    CameraLike,
    LightLike,
    SceneLike,
    argument_text,
    frame_number,
    frame_numbers,
    make_scene,
    options_of,
    scene_file,
)
from renderer.errors import InputError
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
from renderer.scene import (
    FilmScene,
    accuracy_of,
    load_scene as load_scene_file,
)
from renderer.system import ctrl_c_stops_kernels, num_cores

# The output of a scene whose pictures are not written: it allows pictures of any size and background.
_ANY_PICTURE = "{frame}.png"


def load_scene(path: str | os.PathLike[str], *, overrides: Sequence[str] = ()) -> FilmScene:
    """Read and check a scene file.

    Parameters
    ----------
    path
        A YAML file; docs/scene.md lists its keys.
    overrides
        Changes such as `"error.tolerance=0.2"`, as for `--set` of the command.

    Returns
    -------
    FilmScene
        The scene, a frozen dataclass: `dataclasses.replace` makes a changed scene.

    Raises
    ------
    SceneError
        The file has mistakes. The error lists all of them, line by line.

    Examples
    --------
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
    volume
        An array [z, y, x] of integers, booleans or floats, which is never changed; an image of nibabel, ITK, SimpleITK
        or xarray, or a layer of napari, which has its own lengths and axes; or the name of a volume's file. Several in
        a list, or in a mapping from names, make one picture, in which the light of each has a colour of its own and
        adds up. A `Layer` gives a volume its own place and look: `Layer(array, labels={})` shows labels. An array
        without a place lies on the grid of the first volume.
    labels
        A volume of labels that is drawn in the volume, whose surface becomes a translucent shell; several volumes keep
        the colours of channels, and are mixed. A `Layer` gives the labels names. Or, for a volume that is labels
        itself, a mapping from numbers to names, or the keys of `labels` in a scene file.
    mask
        A volume of labels: the picture shows only what is inside of them; a `Layer` chooses some of the labels.
    spacing
        Lengths of a voxel along (x, y, z), in world units; by default 1, or the lengths of the image or the file.
    transfer_function
        By default, a transfer function is suggested, as by `hsplat init`. Other values are the name of a colormap, for
        the colours of the suggestion; `{"preset": "bone"}`, with a preset of `hsplat init --preset`; control points
        `(value, color, opacity)`; or a mapping as in a scene file. Opacities without a `unit` are of matter as thick as
        the smallest spacing.
    light
        Light that matter scatters, in place of shading: studio, outdoor or overcast, as `hsplat init --light` suggests
        it for one volume; or a mapping, as in a scene file. It suits opaque matter, and takes longer.
    camera
        A mapping as in a scene file, or the camera of a scene. Missing keys have the values of a turntable of 120
        frames, 20 degrees above the object, framed so that nothing is cut off.
    size
        (width, height) of the pictures, in pixels; 512 x 512 by default.
    background
        A colour; black by default. "transparent" needs a format that has alpha.
    tolerance
        The error that is allowed; 0.1 by default. Smaller errors take more time; 0 draws every voxel.
    output
        The file that `render` writes; film.mp4 by default.

    Returns
    -------
    FilmScene
        The scene. It leaves out voxels that are NaN, infinite or have a fill value.

    Raises
    ------
    InputError
        The array or the file is no volume.
    SceneError
        A scene cannot have these parameters.

    Examples
    --------
    >>> scene = renderer.suggest_scene(array, spacing=(0.5, 0.5, 1.2))
    >>> scene = renderer.suggest_scene({"nuclei": array, "membranes": array**2}, output="cells.mp4")
    """
    return make_scene(volume, options_of(locals()), is_volume=True)


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

    `suggest_scene` describes the parameters from `labels` on in full. They replace the values of a scene.

    Parameters
    ----------
    scene
        A scene, the name of a scene file, or one or several volumes as in `suggest_scene`, for which a scene is
        suggested.
    frame
        The number of the frame on the camera's path; -1 for the last frame.
    labels
        A volume of labels that is drawn in the volume, or the names of labels.
    mask
        A volume of labels: the picture shows only what is inside of them.
    spacing
        Lengths of a voxel along (x, y, z), in world units.
    transfer_function
        The name of a colormap, a preset, control points or a mapping.
    light
        Light that matter scatters: the name of an environment or a mapping; for a scene, a mapping.
    camera
        A mapping, or the camera of a scene.
    size
        (width, height) of the picture, in pixels.
    background
        A colour, or "transparent".
    tolerance
        The error that is allowed.

    Returns
    -------
    FrameImage
        The picture: a uint8 array [height, width, 3], or [height, width, 4] with straight alpha where the background is
        transparent. It has the bytes that `hsplat render` writes.

    Raises
    ------
    InputError
        The volume or a parameter is wrong.
    SceneError
        The scene is wrong.
    RenderError
        A scene with splats finds no OpenGL.

    Examples
    --------
    >>> image = renderer.render_frame(array, spacing=(1, 1, 2), background="white")
    >>> image = renderer.render_frame(array, labels=array > 100, mask=array > 20)
    >>> image = renderer.render_frame(array, light="studio")
    """
    # Nothing is written, so the picture may have an odd size or be transparent, whatever the scene's output allows.
    made = make_scene(scene, options_of(locals()) | {"output": _ANY_PICTURE})
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
    labels: ImageLike | Layer | Mapping[Any, Any] | None = None,
    mask: ImageLike | Layer | None = None,
    spacing: Sequence[float] | None = None,
    transfer_function: TransferLike | None = None,
    light: LightLike | None = None,
    camera: CameraLike | None = None,
    size: tuple[int, int] | None = None,
    background: str | Sequence[float] | None = None,
    tolerance: float | None = None,
) -> Film:
    """Draw a film and write it with its sidecar, to the same bytes as the command `hsplat render`.

    The file is written whole or not at all, and it never replaces one of the scene's inputs. A film that is up to date
    is not drawn again, and one that was stopped, here or by the command, resumes where it stopped.

    Parameters
    ----------
    scene
        A scene, the name of a scene file, or one or several volumes as in `suggest_scene`, for which a scene is
        suggested.
    output
        The only file to write, in place of the scene's outputs: film.mp4, film.webp and so on, a template such as
        `frames/{frame:04}.png` or, for one frame, a .png.
    frames
        The frames to draw, ascending: `range(0, 30)`, `slice(None, None, 10)`, `-1`; all by default.
    best_effort
        Whether to accept a film that is less accurate than the scene asks for. A budget of seconds is kept as well as
        this machine can; frames that take longer are no error.
    resume
        Whether to keep the frames that an earlier job finished. Further outputs that hold other films are errors then.
        Without it, every frame is drawn, and such files are replaced, as with `--force`.
    on_progress
        A function that is called as `on_progress(num_finished, num_frames)` after each frame that is drawn. An error
        that it raises ends the job, which can be resumed. By default, notebooks show a bar.
    labels, mask, spacing, transfer_function, light, camera, size, background, tolerance : as in suggest_scene
        Replaces the value of a scene.

    Returns
    -------
    Film
        The film, which notebooks play.

    Raises
    ------
    InputError
        The volume or a parameter is wrong.
    SceneError
        The scene is wrong.
    OutputLockedError
        Another job is writing the same output.
    RenderError
        The film cannot be written, or is less accurate than the scene asks for. It is written in the latter case, too.

    Examples
    --------
    >>> film = renderer.render("scene.yaml", output="draft.gif", frames=range(0, 120, 10))
    >>> film = renderer.render(array, spacing=(1, 1, 2), size=(640, 480), output="scan.mp4")
    >>> film.path, film.sidecar
    """
    made = make_scene(scene, options_of(locals()), is_single_frame=True)
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
def preview(
    scene: SceneLike,
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
) -> Page:
    """Return a page that shows a scene before its film is made, as `hsplat preview` does. Nothing is written.

    Parameters
    ----------
    scene
        A scene, the name of a scene file, or one or several volumes as in `suggest_scene`, for which a scene is
        suggested.
    labels, mask, spacing, transfer_function, light, camera, size, background, tolerance : as in suggest_scene
        Replaces the value of a scene.

    Returns
    -------
    Page
        The page, which notebooks display; its `html` is the content of a single file.

    Raises
    ------
    InputError
        The volume or a parameter is wrong.
    SceneError
        The scene is wrong.
    RenderError
        A scene with splats finds no OpenGL.

    Examples
    --------
    >>> Path("page.html").write_text(renderer.preview(array).html, "utf-8")
    """
    made = make_scene(scene, options_of(locals()))
    # This import is not at the top of the file, because the page takes a while to load.
    from hsplat_cli.preview import preview_page

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
    labels: ImageLike | Layer | Mapping[Any, Any] | None = None,
    mask: ImageLike | Layer | None = None,
    spacing: Sequence[float] | None = None,
    transfer_function: TransferLike | None = None,
    light: LightLike | None = None,
    camera: CameraLike | None = None,
    size: tuple[int, int] | None = None,
    background: str | Sequence[float] | None = None,
    tolerance: float | None = None,
) -> ExactImage:
    """Compute the exact picture of a frame: the mean over each pixel of converged ray integrals, without cells.

    With `light`, the mean is taken over paths of light, without the grid on which a film's light is found. This takes
    far longer than drawing: use small pictures.

    Parameters
    ----------
    scene
        A scene, the name of a scene file, or one or several volumes as in `suggest_scene`, for which a scene is
        suggested.
    frame
        The number of the frame on the camera's path; -1 for the last frame.
    standard_error
        With `light`, the wanted standard error of a pixel. Half of it takes four times as long.
    on_progress
        A function that is called with the finished share, from 0 to 1.
    labels, mask, spacing, transfer_function, light, camera, size, background, tolerance : as in suggest_scene
        Replaces the value of a scene. An exact picture has no `tolerance`.

    Returns
    -------
    ExactImage
        The picture over the scene's background, or over black if it is transparent, with its standard error. Without
        `light`, smooth pixels are within about 1e-4 of the truth. Where edges cross a pixel, up to 128 rays have an
        error of their own: pictures of scans have 63 to 69 dB against more rays.

    Raises
    ------
    InputError
        The volume or a parameter is wrong.
    SceneError
        The scene is wrong.
    RenderError
        The integral does not converge.

    Examples
    --------
    >>> error = renderer.render_frame(scene) / 255 - renderer.integrate(scene)
    >>> psnr = -10 * np.log10(np.mean(error**2))
    """
    from renderer.accuracy import TRUTH_TOLERANCE, compute_truth

    if not standard_error > 0:
        raise InputError("the standard error is not positive", where="standard_error", got=f"{standard_error}")
    made = make_scene(scene, options_of(locals()) | {"output": _ANY_PICTURE})
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
