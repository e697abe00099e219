"""Compares the frames of two paths, for the command line and for tests."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from hsplat_cli.compare.comparison_html import Gallery
from hsplat_cli.compare.file_pairs import open_pairs
from hsplat_cli.compare.golden.provenance import PROVENANCE_FILE
from hsplat_cli.compare.outcome import Comparison, Pairs, compare_pair
from hsplat_cli.compare.picture_file import is_picture
from hsplat_cli.compare.report_files import ReportFiles, comparison_table
from hsplat_cli.compare.rules import LIMITS_FILE, Rules, load_rules
from hsplat_cli.compare.scene_pairs import load_numbered_job, open_scene_pairs
from hsplat_cli.scenes import SceneRequest
from hsplat_cli.terminal import Reporter
from renderer.errors import HsplatError, InputError
from renderer.film import folder_files
from renderer.system import join_lines

# Suffixes of the files of scenes, and of the sidecars of films.
_SCENE_SUFFIXES = (".yaml", ".yml", ".json")


def compare_frames(
    request: SceneRequest,
    actual: Path,
    reports: ReportFiles,
    *,
    level: str | None,
    limits: Sequence[str],
    reporter: Reporter,
    option_names: tuple[str, str] = ("--level", "--limit"),
) -> Comparison:
    """Compare the frames of two paths and write the reports.

    request, actual: two PNG pictures, folders, templates or films, of which `request` is the golden one; or a scene, or
    a film's sidecar, and the folder of its goldens.
    level, limits: the values of `--level` and `--limit`. option_names: the names of these two options in messages.

    Raises HsplatError if the paths cannot be compared.
    """
    golden = request.path
    reports.require_names(_input_files(request, actual))
    with reports.locked():
        try:
            reports.prepare()
            draws = _is_scene(golden)
            if not draws and _is_scene(actual):
                hint = f"hsplat compare {actual} {golden}"
                raise InputError(
                    "the scene must come first, then the folder of its goldens", where=str(actual), hint=hint
                )
            rules = load_rules(actual if draws else golden, level, limits, option_names)
            if draws:
                with open_scene_pairs(request, actual, rules, reporter) as pairs:
                    return _compare(pairs, rules, reports, reporter, (str(actual), f"{golden}, drawn now"))
            _reject_scene_options(request, actual)
            with open_pairs(golden, actual) as pairs:
                return _compare(pairs, rules, reports, reporter, (str(golden), str(actual)))
        except Exception as error:
            with contextlib.suppress(HsplatError):  # a report that cannot be written must not hide the reason
                reports.write_failure(golden, actual, error)
            raise


def _reject_scene_options(request: SceneRequest, actual: Path) -> None:
    """Raise InputError for an option that has an effect only if a scene is drawn: two paths of files are compared."""
    options = {
        "frames": request.frames,
        "set": request.overrides,
        "volume": request.volume,
    }
    for option, value in options.items():
        if value:
            got = f"{request.path} and {actual}"
            raise InputError("has no use unless a scene is drawn", where=f"--{option}", got=got)


def _input_files(request: SceneRequest, actual: Path) -> Iterator[Path]:
    """Yield all files that a comparison of two paths may read; for a scene with errors, without its volumes."""
    for side in (request.path, actual):
        if _is_scene(side):
            with contextlib.suppress(HsplatError):
                yield from load_numbered_job(replace(request, path=side)).input_files()
        folder = side if os.path.isdir(side) else side.parent
        yield from (side, folder / PROVENANCE_FILE, folder / LIMITS_FILE)
        yield from (file for file in folder_files(folder) if is_picture(file.name))


def _is_scene(path: Path) -> bool:
    return path.suffix.lower() in _SCENE_SUFFIXES and not os.path.isdir(path)


def _compare(
    pairs: Pairs, rules: Rules, reports: ReportFiles, reporter: Reporter, names: tuple[str, str]
) -> Comparison:
    """Compare all pairs and write the reports. names: the names of the golden and of the actual side."""
    rules.require_frames(pairs.names)
    gallery, outcomes = Gallery(), []
    with reporter.progress(len(pairs.names), label="comparing") as bar:
        for pair in pairs.pairs:
            outcomes.append(compare_pair(pair, rules.limits_for(pair.name)))
            if "--html" in reports.paths:
                gallery.add(outcomes[-1], pair)
            bar.advance()
    comparison = Comparison(
        *names, rules.level, outcomes, [*pairs.notes, *rules.notes], pairs.facts, rules.other_limits
    )
    reports.write(comparison, gallery)
    return comparison


def require_match(
    golden: str | Path,
    actual: str | Path,
    *,
    level: str | None = None,
    limits: Mapping[str, float | None] | None = None,
    html: str | Path | None = None,
) -> None:
    """Raise AssertionError, with the table of `hsplat compare`, if frames exceed their limits.

    The arguments have the same meaning as the arguments of the fixture `assert_frames_match`.
    """
    __tracebackhide__ = True  # pytest hides this function, and shows the line of the test
    overrides = [f"{figure}={'none' if limit is None else limit}" for figure, limit in (limits or {}).items()]
    try:
        comparison = compare_frames(
            SceneRequest(Path(golden)),
            Path(actual),
            ReportFiles({} if html is None else {"--html": Path(html)}),
            level=level,
            limits=overrides,
            reporter=Reporter(is_quiet=True),
            option_names=("level", "limits"),
        )
    except HsplatError as error:
        raise error.with_traceback(None) from None  # its traceback would show only lines of this package
    if not comparison.passes:
        page = [] if html is None else [f"the frames: {html}"]
        lines = [f"{golden} and {actual} do not match", comparison_table(comparison), *page]
        raise AssertionError(join_lines(lines))
