"""One comparison, from two names to a verdict and the reports about it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Protocol

from hsplat_cli.compare.gallery import Gallery
from hsplat_cli.compare.judge import judge, require_packages
from hsplat_cli.compare.outcome import Comparison, Outcome
from hsplat_cli.compare.pair import Pair
from hsplat_cli.compare.pairs import open_pairs
from hsplat_cli.compare.report import json_of, junit_of
from hsplat_cli.compare.rules import load_rules
from hsplat_cli.progress import progress
from renderer.errors import InputError, require_package
from renderer.staging import require_writable, write_staged

# A report under such a name would be written over what is compared, or what it is compared by.
_NOT_REPORTS = (".png", ".mp4", ".gif", ".yaml", ".yml")

_SCENE_SUFFIXES = (".yaml", ".yml", ".json")


class AnyPairs(Protocol):
    """Pairs of frames, at least one: of files, or of a scene and its goldens."""

    @property
    def names(self) -> Sequence[str]:
        """Of all pairs."""

    @property
    def notes(self) -> Sequence[str]:
        """As in Comparison."""

    @property
    def facts(self) -> Mapping[str, tuple[str, str]]:
        """As in Comparison."""

    def __iter__(self) -> Iterator[Pair]: ...


@dataclass(frozen=True)
class SceneOptions:
    """What only a scene has a use for, which is drawn for the comparison: as the options of `hsplat render`."""

    frames: str | None = None
    overrides: Sequence[str] = ()
    volume: Path | None = None
    workers: int | None = None


@dataclass(frozen=True)
class ReportFiles:
    """Where reports are asked for; None for those that are not."""

    json: Path | None = None
    junit: Path | None = None
    html: Path | None = None

    def require_writable(self) -> None:
        """Raise InputError or RenderError where one of them cannot be made; missing folders are made."""
        given = {"--json": self.json, "--junit": self.junit, "--html": self.html}
        taken: dict[Path, str] = {}
        for option, path in given.items():
            if path is None:
                continue
            if path.suffix.lower() in _NOT_REPORTS:
                raise InputError("not a name for a report", where=f"{option} {path}", got=f"a {path.suffix} file")
            if (other := taken.setdefault(path.absolute(), option)) != option:
                raise InputError("two reports in one file", where=f"{option} {path}", got=f"the same as {other}")
            require_writable(path)
        if self.html is not None:
            require_package("jinja2", extra="compare")

    def write(self, comparison: Comparison, gallery: Gallery) -> None:
        """Write each, whole or not at all, when all are made."""
        texts: dict[Path, str] = {}
        if self.json is not None:
            texts[self.json] = json_of(comparison)
        if self.junit is not None:
            texts[self.junit] = junit_of(comparison)
        if self.html is not None:
            # Imported where it is used: it needs a package that the rest does without.
            from hsplat_cli.compare.page import comparison_page  # noqa: PLC0415

            texts[self.html] = comparison_page(comparison, gallery)
        for path, text in texts.items():
            write_staged(path, text.encode())


def run_comparison(
    golden: Path,
    actual: Path,
    *,
    level: str | None = None,
    limits: Sequence[str] = (),
    reports: ReportFiles = ReportFiles(),
    scene_options: SceneOptions = SceneOptions(),
    quiet: bool = True,
) -> Comparison:
    """Compare two pictures, folders, templates or films, or a scene with the folder of its goldens; write the reports.

    level, limits: of the strictness, and `FIGURE=VALUE`, instead of those in the file beside the goldens.

    Raises InputError where something cannot be compared, in which case no report is written, and RenderError where a
    scene cannot be drawn or a report not be written, which shows before the work if it can.
    """
    is_scene = golden.suffix.lower() in _SCENE_SUFFIXES
    if not is_scene and scene_options != SceneOptions():
        what = "--frames, --set, --volume and --workers are for a scene, which is drawn"
        raise InputError(what, where=str(golden), hint="hsplat compare SCENE FOLDER")
    goldens, others = (actual, golden) if is_scene else (golden, actual)
    reports.require_writable()
    rules = load_rules(goldens, level, limits)
    require_packages(rules)
    gallery = Gallery()
    with _open_scene(golden, actual, scene_options, quiet) if is_scene else open_pairs(golden, actual) as pairs:
        rules.require_frames(pairs.names)
        with progress(len(pairs.names), label="comparing", quiet=quiet) as done:

            def see(outcome: Outcome, pair: Pair) -> None:
                if reports.html is not None:
                    gallery.see(outcome, pair)
                done.advance()

            outcomes = judge(pairs, rules, see)
        comparison = Comparison(str(goldens), str(others), rules.level, outcomes, pairs.notes, pairs.facts)
    reports.write(comparison, gallery)
    return comparison


def _open_scene(scene: Path, folder: Path, options: SceneOptions, quiet: bool) -> AbstractContextManager[AnyPairs]:
    # Imported where it is used: what draws takes longer to load than comparing pictures takes.
    from hsplat_cli.compare.scene import compare_scene  # noqa: PLC0415

    return compare_scene(scene, folder, **asdict(options), quiet=quiet)
