"""Loads the job of a command: a scene, and the frames of the scene that are drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from hsplat_cli.terminal import is_one_frame, parse_frames
from renderer.errors import InputError, SceneError
from renderer.film import film_path_of_sidecar, sidecar_path_of_file
from renderer.job import FilmJob
from renderer.scene import (
    FilmScene,
    TreeEditor,
    YamlTree,
    accuracy_of,
    edit_scene_content,
    found_path,
    is_film_wide_goal,
    is_same_file,
    may_be_json,
    output_suffix,
    outputs_of,
    raise_problems,
    read_content,
)

if TYPE_CHECKING:
    from renderer.record import FilmRecord, FinishedFilm

# The option that names a volume's file if the file was moved, by the key of the file in the scene.
_VOLUME_OPTIONS = {"volume.file": "--volume", "volume.raw.file": "--set volume.raw.file=FILE"}
# Keys of paths of files in a scene; a change of a path alone changes no pixel of a film.
_PLACE_KEYS = ("output.file", *_VOLUME_OPTIONS)

# What is read of the volumes when a job is loaded: `all` for everything that the scene leaves open, such as channels;
# `labels` for the labels that the scene names; or `nothing`.
Reads = Literal["all", "labels", "nothing"]
# What a command writes under the name of the output: the `film` at once; `passes`, coarser films first; or `nothing`.
Draws = Literal["film", "passes", "nothing"]


@dataclass(frozen=True)
class SceneRequest:
    """Holds the scene that a command line names: the file of a scene or a sidecar, and the changes by options.

    path: the file of the scene or sidecar. overrides: the values of `--set`. volume, output: the values of these
    options. frames: the value of `--frames`, a Python slice. content: the content of the file, if it is known; the file
    need not exist then.
    """

    path: Path
    overrides: Sequence[str] = ()
    volume: Path | str | None = None
    frames: str | None = None
    output: Path | str | None = None
    content: bytes | None = None


def load_job(request: SceneRequest, draws: Draws = "film", reads: Reads = "all") -> FilmJob:
    """Load the job of a scene file or a sidecar, with the changes of the command line's options.

    The job of a sidecar makes the recorded film again, or another film in another place. Raises InputError, and
    SceneError with all mistakes in the scene.
    """
    content = read_content(request.path) if request.content is None else request.content
    if may_be_json(content):
        from renderer.record import FinishedFilm, parse_film_record

        record = parse_film_record(content, request.path)
        if record is not None:
            return _load_original(FinishedFilm(request.path, record), request, draws)
    editor = edit_scene_content(content, request.path, request.overrides, request.volume, request.output)
    scene = editor.parse(is_single_frame=is_one_frame(request.frames))
    if reads == "all":
        scene = _resolved(scene, editor)
    elif reads == "labels":
        _require_labels(scene, editor)
    picked = parse_frames(request.frames, scene.num_frames)
    job = FilmJob(scene, picked, accuracy_of(scene.error), path=request.path)
    if draws != "nothing":
        job.require_harmless()
    return job


def _resolved(scene: FilmScene, editor: TreeEditor) -> FilmScene:
    """Read the volumes, if values of the scene depend on voxels; return the scene with these values.

    editor: the editor that parsed the scene, which finds the lines of problems.
    """
    if not any(layer.depends_on_voxels for layer in scene.at(0).layers):
        return scene
    from renderer.readers import read_volume
    from renderer.resolve import resolve_scene

    try:
        return resolve_scene(scene, read_volume)
    except SceneError as error:
        raise SceneError(editor.located_problems(error.problems)) from None


def _require_labels(scene: FilmScene, editor: TreeEditor) -> None:
    """Read the volumes of labels; raise SceneError for labels that the scene names, but that no voxel has."""
    from renderer.readers import read_volume
    from renderer.resolve import label_problems

    raise_problems(editor.located_problems(label_problems(scene, read_volume)))


def load_film(film: Path, volume: Path | str | None) -> FilmJob:
    """Load the job that made a film.

    film: the file of the film, the template of its numbered frames, or its sidecar. volume: the new place of the film's
    volume, if the volume was moved. Raises InputError where there is no sidecar, and SceneError.
    """
    from renderer.record import FinishedFilm

    path, record = read_film_record(film)
    return _load_original(FinishedFilm(path, record), SceneRequest(path, volume=volume), "nothing")


def read_film_record(film: Path) -> tuple[Path, FilmRecord]:
    """Return the sidecar of a film and the record in it. Raises InputError where there is none.

    film: the file of the film, the template of its numbered frames, or its sidecar."""
    from renderer.record import parse_film_record

    is_sidecar = output_suffix(film) == ".json"
    path = film if is_sidecar or not film.name else sidecar_path_of_file(film, (), 0)
    if not is_sidecar and not path.exists():
        hint = "name the film (of several files the first), frames/{frame:04}.png, or the .json file beside them"
        raise InputError("no sidecar of this film", where=str(film), expected=str(path), hint=hint)
    record = parse_film_record(read_content(path), path)
    if record is None:
        raise InputError("not the sidecar of a film", where=str(path))
    return path, record


def _load_original(original: FinishedFilm, request: SceneRequest, draws: Draws) -> FilmJob:
    """Load the job that makes a recorded film again, with the changes of the command line's options."""
    from renderer.record import late_frame_problems

    path, record, frames = original.path, original.record, request.frames
    editor = _editor(record, path)
    editor.apply(request.overrides, request.volume, request.output)
    scene = _resolved(editor.parse(is_single_frame=is_one_frame(frames) or len(record.frames) <= 1), editor)
    problems = late_frame_problems(record, scene.num_frames)
    raise_problems(replace(problem, location=str(path)) for problem in problems)
    recorded = None if frames is not None and _has_whole_schedule(record, editor) else record.numbers
    picked = parse_frames(frames, scene.num_frames, recorded)
    job = FilmJob(scene, picked, accuracy_of(scene.error), original, path)
    is_changed = any(key not in _PLACE_KEYS for key in editor.overridden_paths)
    is_beside = is_same_file(path, job.sidecar)
    is_elsewhere = not {"output", "output.file"}.isdisjoint(editor.overridden_paths) and not is_beside
    is_whole = [*picked] == [*record.numbers]
    if draws != "nothing" and not is_elsewhere and (is_changed or not is_whole or draws == "passes"):
        raise InputError("this would overwrite the recorded film", where=str(path), hint="--output names another file")
    if draws != "nothing":
        job.require_harmless()
    if is_changed or not original.has_tolerances_of(scene):
        return replace(job, repeats="nothing")
    requested = record.schedule.requested
    if not is_whole and is_film_wide_goal(requested):
        return replace(job, repeats="frames")
    return replace(job, requested=requested)


def _has_whole_schedule(record: FilmRecord, editor: TreeEditor) -> bool:
    """Return whether the scene's schedule applies to any frame of the path, not only to the recorded frames."""
    is_new = any(key == "error" or key.startswith("error.") for key in editor.overridden_paths)
    return is_new or record.schedule.requested.goal is None


def _editor(record: FilmRecord, path: Path) -> TreeEditor:
    """Return an editor of the recorded scene, with the film beside the sidecar as output, even if both were moved."""
    scene, (first, *others) = {**record.scene}, outputs_of(record.scene)
    if isinstance(first.get("file"), str):
        first = {**first, "file": str(film_path_of_sidecar(path, Path(first["file"])))}
        others = [{**each, "file": found_path(str(each.get("file")), path.parent)} for each in others]
        scene["output"] = [first, *others] if others else first
    options = {**_VOLUME_OPTIONS, "volume.file.0": "--volume"}  # the key of the first file of a list
    hints = {key: f"if it was moved, {option} names it" for key, option in options.items()}
    return TreeEditor(YamlTree(scene), path, path_prefix="scene", hints=hints)
