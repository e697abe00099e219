"""Two names, of whatever frames they stand for, to what came of comparing them: for the command line and for tests."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from hsplat_cli.compare.file_pairs import open_pairs
from hsplat_cli.compare.golden.provenance import PROVENANCE_FILE
from hsplat_cli.compare.judge import require_packages
from hsplat_cli.compare.outcome import Comparison
from hsplat_cli.compare.rules import load_rules
from hsplat_cli.compare.run import PairSource, ReportFiles, run_comparison
from hsplat_cli.compare.scene_pairs import SceneOptions, open_scene_pairs
from hsplat_cli.compare.text_reports import comparison_table
from renderer.errors import HsplatError, InputError

# A scene, or the sidecar of a film.
_SCENE_SUFFIXES = (".yaml", ".yml", ".json")


def compare_frames(
    golden: Path,
    actual: Path,
    reports: ReportFiles,
    drawing: SceneOptions,
    *,
    level: str | None,
    limits: Sequence[str],
    quiet: bool,
    option_names: tuple[str, str] = ("--level", "--limit"),
) -> Comparison:
    """What came of a comparison, with its reports written.

    golden, actual: as `open_pairs` takes them; or a scene, or the sidecar of a film, and the folder of its goldens.
    drawing: how the scene is drawn. level, limits: as `--level` and `--limit` give them, or else what `option_names`
    names. quiet: do not show how far the work is.

    Raises HsplatError where they cannot be compared.
    """
    reports.require_names((golden, actual, golden / PROVENANCE_FILE, actual / PROVENANCE_FILE))
    with _failure_reported(reports, golden, actual):
        reports.prepare()
        folder = _goldens_folder(golden, actual)
        rules = load_rules(folder or golden, level, limits, option_names)
        require_packages(rules)
        if folder is None and drawing.given:
            raise InputError("of no use where no scene is drawn", where=drawing.given[0], got=f"{golden} and {actual}")
        opened: contextlib.AbstractContextManager[PairSource]
        if folder is None:
            opened, names = open_pairs(golden, actual), (str(golden), str(actual))
        else:
            opened = open_scene_pairs(golden, folder, drawing, rules, quiet=quiet)
            names = (str(folder), f"{golden}, drawn now")
        with opened as pairs:
            return run_comparison(pairs, rules, golden=names[0], actual=names[1], reports=reports, quiet=quiet)


@contextlib.contextmanager
def _failure_reported(reports: ReportFiles, golden: Path, actual: Path) -> Iterator[None]:
    """What keeps frames from being compared stands in the reports, too."""
    try:
        yield
    except Exception as error:
        why = str(error) if isinstance(error, HsplatError) else f"{type(error).__name__}: {error}"
        with contextlib.suppress(HsplatError):  # a report that cannot be written either must not hide the reason
            reports.write_failure(str(golden), str(actual), why)
        raise


def _goldens_folder(golden: Path, actual: Path) -> Path | None:
    """The folder of a scene's goldens, where there is a scene. Raises InputError where it is not in its place."""
    if golden.suffix.lower() in _SCENE_SUFFIXES and not os.path.isdir(golden):
        return actual
    if actual.suffix.lower() in _SCENE_SUFFIXES and not os.path.isdir(actual):
        hint = f"hsplat compare {actual} {golden}"
        raise InputError("the scene comes first, and then the folder of its goldens", where=str(actual), hint=hint)
    return None


def require_match(
    golden: str | Path,
    actual: str | Path,
    *,
    level: str | None = None,
    limits: Mapping[str, float | None] | None = None,
    html: str | Path | None = None,
) -> None:
    """Raise AssertionError, with the table of `hsplat compare`, where frames differ by more than they may.

    As the fixture of `pytest_plugin` describes it.
    """
    __tracebackhide__ = True  # for pytest: what has failed is the line of the test
    overrides = [f"{figure}={'none' if limit is None else limit}" for figure, limit in (limits or {}).items()]
    reports = ReportFiles(html=None if html is None else Path(html))
    try:
        comparison = compare_frames(
            Path(golden),
            Path(actual),
            reports,
            SceneOptions(),
            level=level,
            limits=overrides,
            quiet=True,
            option_names=("level", "limits"),
        )
    except HsplatError as error:
        raise error.with_traceback(None) from None  # a test shows what is wrong, and not where it was found out
    if not comparison.passes:
        page = "" if html is None else f"\nthe frames: {html}"
        raise AssertionError(f"{golden} and {actual} do not match\n{comparison_table(comparison)}{page}")
