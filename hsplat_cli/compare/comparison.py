"""Compare the scenes of a project with their goldens, or existing pictures with others, and write a report."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from hsplat_cli.compare.file_pairs import compare_files, is_picture_set
from hsplat_cli.compare.golden.project import GoldenProject, SceneRules, find_project, unused_error
from hsplat_cli.compare.golden.scene_comparison import compare_scene
from hsplat_cli.compare.limit import SAME_BYTES
from hsplat_cli.compare.outcome import ComparedFilm, Comparison, Mistake
from hsplat_cli.compare.report_folder import ReportFolder, open_report
from hsplat_cli.scenes import SceneRequest
from hsplat_cli.terminal import Reporter
from renderer.errors import HsplatError, InputError, SceneError


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
            comparison = Comparison((_files(pair, request, report, reporter),))
        report.write(comparison)
    return comparison


def _pictures(request: ComparisonRequest) -> tuple[Path, Path] | None:
    """Return the two sets of pictures that a request names; None for scenes."""
    if "" in request.places:  # as of an unset variable
        raise InputError("an empty name", expected="scenes, or two sets of pictures")
    pictures = [place for place in request.places if is_picture_set(place)]
    if not pictures:
        return None
    if len(pictures) < len(request.places):
        raise InputError(
            "scenes are not compared with pictures",
            got=" and ".join(request.places),
            expected="scenes, or two sets of pictures",
            hint=f"`--goldens {pictures[-1]}` names the folder of all goldens",
        )
    if len(pictures) != 2:
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


def _files(
    pair: tuple[Path, Path], request: ComparisonRequest, report: ReportFolder, reporter: Reporter
) -> ComparedFilm:
    return compare_files(*pair, request.rules.limit or SAME_BYTES, report.pictures(0), reporter)


def _scenes(request: ComparisonRequest, report: ReportFolder, reporter: Reporter) -> list[ComparedFilm]:
    """Compare all scenes of a project, one after the other."""
    project = find_project(request.places, request.goldens, replace(request.rules, frames=None))
    films = []
    for number, scene in enumerate(project.scenes):
        if len(project.scenes) > 1:
            reporter.status(f"{scene.name} ({number + 1} of {len(project.scenes)})")
        of_scene = SceneRequest(scene.file, request.overrides, request.volume, request.rules.frames)
        store = report.pictures(number)
        try:
            film = compare_scene(scene, of_scene, store, _place, reporter)
        except HsplatError as error:
            store.drop()
            limit = str(scene.rules.limit or SAME_BYTES)
            goldens = _place(scene.folder.path)
            film = ComparedFilm(
                scene.name, limit, _place(scene.file), goldens, error=error_line(error),
                mistakes=tuple(_mistakes(error, scene.file)),
            )  # fmt: skip
        films.append(film)
    return [*films, *_unused(project, _arguments(request))]


def _place(path: Path) -> str:
    """Return a path as people name it: relative to the current folder, with forward slashes."""
    return Path(os.path.relpath(path)).as_posix()


def error_line(error: HsplatError) -> str:
    """Return the text of an error in one line."""
    return _in_one_line(str(error))


def _mistakes(error: HsplatError, file: Path) -> Iterator[Mistake]:
    """Yield the mistakes in the file of a scene that an error lists. A missing key is told at the first line."""
    for problem in error.problems if isinstance(error, SceneError) else ():
        line = (problem.location or "").removeprefix(f"{file}:").partition(":")[0]
        yield Mistake(_in_one_line(str(replace(problem, location=None))), int(line) if line.isdecimal() else 1)


def _in_one_line(text: str) -> str:
    """Return a message in one line, without the excerpt of a file, whose lines begin with a bar."""
    return "; ".join(line.strip() for line in text.splitlines() if not line.strip().startswith("|"))


def _unused(project: GoldenProject, arguments: Sequence[str]) -> Iterator[ComparedFilm]:
    """Yield an outcome for the goldens that no scene of the project has: a scene was renamed, or removed."""
    for folder in project.unused:
        error = error_line(unused_error(folder, arguments))
        yield ComparedFilm(_place(folder.path), str(SAME_BYTES), goldens=_place(folder.path), error=error)
