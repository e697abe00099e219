"""Compare the scenes of a project with their goldens, or existing pictures with others, and write a report."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from hsplat_cli.compare.file_pairs import compare_files, is_picture_set
from hsplat_cli.compare.golden.project import NO_SCENE, SceneRules, find_project, unused_error
from hsplat_cli.compare.golden.scene_comparison import compare_scene, error_line, shown_place
from hsplat_cli.compare.limit import SAME_BYTES
from hsplat_cli.compare.outcome import ComparedFilm, Comparison
from hsplat_cli.compare.report_folder import PictureStore, open_report, write_report
from hsplat_cli.scenes import SceneRequest
from hsplat_cli.terminal import Reporter
from renderer.errors import InputError
from renderer.scene import missing_file_error


@dataclass(frozen=True)
class ComparisonRequest:
    """A comparison that a command line asks for.

    places: scenes, folders, patterns or a golden.yaml; or two sets of pictures, of which the first is golden.
    rules: the frames and the limit of the options. goldens: the folder of all goldens. report: that of the report.
    overrides, volume: changes of all scenes, as in SceneRequest.
    """

    places: Sequence[str] = ()
    rules: SceneRules = field(default_factory=SceneRules)
    goldens: Path | None = None
    report: Path | None = None
    overrides: Sequence[str] = ()
    volume: Path | str | None = None


def compare(request: ComparisonRequest, reporter: Reporter) -> Comparison:
    """Compare what a request names, and write its report.

    A scene that cannot be compared is an outcome of its own. Raises HsplatError if nothing can be compared at all.
    """
    with open_report(request.report, _inputs(request)) as report:
        pair = _pictures(request)
        if pair is None:
            comparison = Comparison(tuple(_scenes(request, report, reporter)), tuple(_arguments(request)))
        else:
            limit = request.rules.limit or SAME_BYTES
            comparison = Comparison((compare_files(*pair, limit, PictureStore(report, 0), reporter),))
        write_report(report, comparison)
    return comparison


def _pictures(request: ComparisonRequest) -> tuple[Path, Path] | None:
    """Return the two sets of pictures that a request names; None for scenes."""
    if "" in request.places:  # as of an unset variable
        raise InputError("an empty name", expected="scenes, or two sets of pictures")
    pictures = [place for place in request.places if is_picture_set(place)]
    if not pictures:
        return None
    is_pair = len(pictures) == len(request.places) == 2
    lost = [Path(each) for each in pictures if "{" not in each and not os.path.exists(each)]
    if lost and not is_pair:
        raise missing_file_error(lost[0], NO_SCENE)
    if len(pictures) < len(request.places):
        raise InputError(
            "scenes are not compared with pictures",
            got=" and ".join(request.places),
            expected="scenes, or two sets of pictures",
            hint=f"`--goldens {pictures[-1]}` names the folder of all goldens",
        )
    if not is_pair:
        raise InputError(
            "pictures are compared in pairs", got=" and ".join(pictures), expected="GOLDEN and ACTUAL, or scenes"
        )
    options: dict[str, object] = {"--goldens": request.goldens, "--frames": request.rules.frames}
    options |= {"--set": request.overrides, "--volume": request.volume}
    for option, value in options.items():
        if value:
            raise InputError("has no use unless scenes are drawn", where=option, got=" and ".join(request.places))
    golden, actual = map(Path, request.places)
    return golden, actual


def _inputs(request: ComparisonRequest) -> list[Path]:
    """Return the files and folders that a command line names."""
    return [Path(each) for each in (*request.places, request.goldens, request.volume) if each is not None]


def _arguments(request: ComparisonRequest) -> list[str]:
    """Return the words by which `hsplat golden` finds the scenes and the goldens of a request."""
    goldens = [] if request.goldens is None else ["--goldens", str(request.goldens)]
    return [*request.places, *goldens]


def _scenes(request: ComparisonRequest, report: Path | None, reporter: Reporter) -> Iterator[ComparedFilm]:
    """Compare all scenes of a project, one after the other. Goldens that no scene has are an outcome, too."""
    project = find_project(request.places, request.goldens, replace(request.rules, frames=None))
    for number, scene in enumerate(project.scenes):
        if len(project.scenes) > 1:
            reporter.status(f"{scene.name} ({number + 1} of {len(project.scenes)})")
        of_scene = SceneRequest(scene.file, request.overrides, request.volume, request.rules.frames)
        yield compare_scene(scene, of_scene, PictureStore(report, number), reporter)
    for folder in project.unused:  # their scene was renamed, or removed
        place, error = shown_place(folder.path), error_line(unused_error(folder, _arguments(request)))
        yield ComparedFilm(place, str(SAME_BYTES), goldens=place, error=error)
