"""Loads what a command draws: a scene, and which frames of it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

from hsplat_cli.scenes.sidecar_file import Sidecar, parse_sidecar
from hsplat_cli.terminal import is_one_frame, parse_frames
from renderer.errors import InputError, Problem
from renderer.film import film_files, film_path_of_sidecar, require_no_input, sidecar_path, volume_files
from renderer.scene import (
    Scene,
    SceneEditor,
    TreeNode,
    YamlTree,
    check_frame_in_path,
    is_film_wide_goal,
    is_same_file,
    parse_scene_content,
    raise_problems,
    read_content,
    schedule_to_dict,
    tolerance_at,
)

# What names a volume that is not found. These keys say where the voxels are, and change no film.
_VOLUME_OPTIONS = {"volume.file": "--volume", "volume.raw.file": "--set volume.raw.file=FILE"}
# Nor do these change it: where it is, and whether that is recorded.
_PLACE_KEYS = ("output.file", "output.record_paths", *_VOLUME_OPTIONS)


@dataclass(frozen=True)
class Job:
    """A scene, and what to draw of it.

    frames: their numbers, ascending. requested_error: the accuracy, as a section `error`: `{"splats": 100000}`.
    original: the film that is made again, if any. path: the scene file or the sidecar that was read, if any.
    """

    scene: Scene
    frames: Sequence[int]
    requested_error: Mapping[str, Any]
    original: Sidecar | None = None
    path: Path | None = None

    def input_files(self) -> Iterator[Path]:
        """Yield the files that the job reads: its own, and those of the volume."""
        if self.path is not None:
            yield self.path
        yield from volume_files(self.scene.volume)


def load_job(
    path: Path,
    *,
    overrides: Sequence[str] = (),
    frames: str | None = None,
    volume: Path | None = None,
    output: Path | str | None = None,
    draws: Literal["film", "passes", "nothing"] = "film",
) -> Job:
    """Load the job of a scene file or a sidecar, with the changes of the command line's options.

    The job of a sidecar makes its film again, or another one elsewhere. draws: what appears under the name of the
    output: the film at once, or coarser passes first. Raises InputError, and SceneError as `load_scene`.
    """
    content = read_content(path)
    still = is_one_frame(frames)
    sidecar = parse_sidecar(content, path)
    if sidecar is None:
        scene = parse_scene_content(
            content, path, overrides=overrides, volume=volume, output=output, is_single_frame=still
        )
        picked = parse_frames(frames, scene.camera.path.frames)
        job = Job(scene, picked, schedule_to_dict(scene.error), path=path)
        if draws != "nothing":
            _require_no_input(job)
        return job
    editor = _editor(sidecar)
    editor.apply(overrides, volume, output)
    scene = editor.parse(is_single_frame=still or len(sidecar.frames) <= 1, extra_problems=sidecar.problems)
    _require_in_path(sidecar, scene)
    recorded = None if frames is not None and _has_whole_schedule(sidecar, editor) else sidecar.frames
    picked = parse_frames(frames, scene.camera.path.frames, recorded)
    is_changed = any(key not in _PLACE_KEYS for key in editor.overridden_paths)
    is_beside = is_same_file(path, sidecar_path(scene, picked))
    is_elsewhere = ("output.file" in editor.overridden_paths or "output" in editor.overridden_paths) and not is_beside
    is_whole = [*picked] == [*sidecar.frames]
    if draws != "nothing" and not is_elsewhere and (is_changed or not is_whole or draws == "passes"):
        raise InputError(
            "this would overwrite the recorded film",
            where=str(path),
            hint="--output names another file",
        )
    job = Job(scene, picked, schedule_to_dict(scene.error), sidecar, path)
    if draws != "nothing":
        _require_no_input(job, rewrites_sidecar=is_beside)
    if is_changed or not _has_recorded_tolerances(sidecar, scene):
        return replace(job, original=replace(sidecar, other_schedule_keys={}, tool_versions={}))
    if not is_whole and is_film_wide_goal(sidecar.requested_error):
        return replace(job, original=replace(sidecar, other_schedule_keys={}))
    return replace(job, requested_error=schedule_to_dict(sidecar.requested_error))


def _require_no_input(job: Job, *, rewrites_sidecar: bool = False) -> None:
    """Raise InputError where an output is an input.

    rewrites_sidecar: the job's file is the sidecar of its output, which is written again.
    """
    sidecar = sidecar_path(job.scene, job.frames)
    outputs = film_files(job.scene.output, job.frames, sidecar)
    if rewrites_sidecar:
        require_no_input([sidecar], volume_files(job.scene.volume))
        outputs = (file for file in outputs if file != sidecar)
    require_no_input(outputs, job.input_files())


def _has_recorded_tolerances(sidecar: Sidecar, scene: Scene) -> bool:
    """Return whether the recorded scene has the tolerances at which the frames were drawn, unchanged by hand."""
    drawn = zip(sidecar.frames, sidecar.tolerances, strict=True)
    return scene.error.goal is None and all(tolerance_at(scene.error, frame) == recorded for frame, recorded in drawn)


def _has_whole_schedule(sidecar: Sidecar, editor: SceneEditor) -> bool:
    """Return whether the scene has the accuracy of all frames of the path, not only of the drawn ones."""
    is_new = any(key == "error" or key.startswith("error.") for key in editor.overridden_paths)
    return is_new or sidecar.requested_error.goal is None


def _editor(sidecar: Sidecar) -> SceneEditor:
    """Return an editor of the recorded scene; its output is the film beside the sidecar, wherever they are now."""
    scene, path = sidecar.scene, sidecar.path
    output = scene.get("output")
    if isinstance(output, dict) and isinstance(output.get("file"), str):
        output["file"] = str(film_path_of_sidecar(path, Path(output["file"])))
    has_paths = not isinstance(output, dict) or output.get("record_paths", True)
    why = "if it was moved," if has_paths else "the sidecar was written without paths:"
    hints = {key: f"{why} {option} names it" for key, option in _VOLUME_OPTIONS.items()}
    return SceneEditor(YamlTree(scene), path, path_prefix="scene", hints=hints)


def _require_in_path(sidecar: Sidecar, scene: Scene) -> None:
    problems: list[Problem] = []
    last = len(sidecar.frames) - 1
    node = TreeNode(None, f"frames.{last}.frame", problems)
    check_frame_in_path(node, sidecar.frames[last], scene.camera.path.frames)
    raise_problems(replace(problem, location=str(sidecar.path)) for problem in problems)
