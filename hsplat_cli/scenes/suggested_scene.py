"""Suggests a scene, as text, that shows a volume."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from hsplat_cli.scenes.scene_text import FilmOptions, scene_text
from hsplat_cli.scenes.volume_arguments import read_with_options
from hsplat_cli.terminal import Reporter
from renderer.errors import Problem, SceneError
from renderer.scene import VolumeSpec, parse_scene_content

# The option that each value of a scene came from.
_OPTIONS = {
    "volume.spacing": "--spacing",
    "volume.raw.spacing": "--spacing",
    "output.background": "--background",
    "output.size": "--size",
    "output.frames_per_second": "--fps",
    "output.file": "the name of the film",
    "error.tolerance": "--tolerance",
    "camera.path.frames": "--frames",
    "camera.path.elevation": "--elevation",
}


@dataclass(frozen=True)
class SuggestedScene:
    """A scene suggested for a volume.

    text: the YAML. kind, reason: what the volume is taken for, and why. notes: about values that are not shown.
    """

    text: str
    kind: str
    reason: str
    notes: tuple[str, ...] = ()


def suggest_scene(
    volume: VolumeSpec,
    film: FilmOptions,
    reporter: Reporter,
    *,
    colormap: str | None,
    scene: Path,
    output: Path,
    hides_nonfinite: bool = False,
) -> SuggestedScene:
    """Return a scene for the file `scene`.

    hides_nonfinite: where `volume` has the `lowest` value for NaN and infinities, and another value is less visible,
    use that. Raises InputError for a volume that cannot be read or drawn, and SceneError for an option, such as the
    background, that cannot be in a scene.
    """
    from renderer.suggest import suggest_for

    found = suggest_for(
        volume, lambda spec: read_with_options(spec, reporter), colormap=colormap, hides_nonfinite=hides_nonfinite
    )
    text = scene_text(found, film, folder=scene.parent, output=output)
    _check(text, scene)
    chosen = found.suggestion
    notes = chosen.outlier_notes if found.nonfinite is None else (*chosen.outlier_notes, found.nonfinite)
    return SuggestedScene(text, chosen.kind, chosen.reason, notes)


def _check(text: str, scene: Path) -> None:
    """Raise SceneError, with the options, for values that cannot be in a scene, such as odd sizes of an MP4.

    Nothing is written yet, so no line can be shown.
    """
    try:
        parse_scene_content(text.encode(), scene)
    except SceneError as error:
        raise SceneError([_at_option(problem) for problem in error.problems]) from error


def _at_option(problem: Problem) -> Problem:
    location = _OPTIONS.get(problem.path, "the scene that was suggested")
    return replace(problem, what=problem.what.partition("\n")[0], location=location)
