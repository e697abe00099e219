"""One comparison from its pairs to its reports."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from hsplat_cli.compare.gallery import Gallery
from hsplat_cli.compare.judge import judge
from hsplat_cli.compare.outcome import Comparison, Failure, Outcome
from hsplat_cli.compare.pair import Pair
from hsplat_cli.compare.rules import Rules
from hsplat_cli.compare.text_reports import comparison_json, comparison_junit, failure_json, failure_junit
from hsplat_cli.terminal import progress
from renderer.errors import InputError, require_package
from renderer.film import require_writable, staged_files, translate_os_errors
from renderer.scene import is_same_file

# No report has the name of a frame, a scene or a volume: a slip of the pen costs none of them.
_SUFFIXES = {"--json": (".json",), "--junit": (".xml",), "--html": (".html", ".htm")}


class PairSource(Protocol):
    """Pairs of frames, at least one: those of `open_pairs`, or of a scene. facts, notes: as in Comparison."""

    @property
    def names(self) -> Sequence[str]:
        """Of all pairs."""

    @property
    def notes(self) -> Sequence[str]:
        """What the user should know about them."""

    @property
    def facts(self) -> Mapping[str, tuple[str, str]]:
        """About both sides."""

    def __iter__(self) -> Iterator[Pair]: ...


@dataclass(frozen=True)
class ReportFiles:
    """Where reports are asked for; None for those that are not."""

    json: Path | None = None
    junit: Path | None = None
    html: Path | None = None

    @property
    def paths(self) -> dict[str, Path]:
        """Of those that are asked for, by their options."""
        given = {"--json": self.json, "--junit": self.junit, "--html": self.html}
        return {option: path for option, path in given.items() if path is not None}

    def require_names(self, inputs: Sequence[Path]) -> None:
        """Raise InputError where a name is not that of a report, or of what is compared: `inputs`, if they are there.

        Nothing is written, and no folder is made.
        """
        for option, path in self.paths.items():
            where, suffixes = f"{option} {path}", _SUFFIXES[option]
            if path.suffix.lower() not in suffixes:
                got = f"a {path.suffix} file" if path.suffix else "no suffix"
                raise InputError("not a name for a report", where=where, got=got, expected=f"a {suffixes[0]} file")
            if os.path.exists(path) and not os.path.isfile(path):  # a device, or a pipe
                got = "a folder" if os.path.isdir(path) else "something that is no file"
                raise InputError("a report cannot take the place of this", where=where, got=got)
            if any(is_same_file(path, other) for other in inputs):
                raise InputError("a report would be written over what is compared", where=where)

    def prepare(self) -> None:
        """Remove those of an earlier comparison, which would say that all is well while this one fails.

        Raises InputError or RenderError where one of them cannot be written; missing folders are made.
        """
        for path in self.paths.values():
            with translate_os_errors(path):
                path.unlink(missing_ok=True)
        for path in self.paths.values():
            require_writable(path)
        if self.html is not None:
            require_package("jinja2", extra="compare")

    def write(self, comparison: Comparison, gallery: Gallery) -> None:
        """Write all of them, whole, or none."""
        texts: dict[Path, str] = {}
        if self.json is not None:
            texts[self.json] = comparison_json(comparison)
        if self.junit is not None:
            texts[self.junit] = comparison_junit(comparison)
        if self.html is not None:
            # Imported where it is used: it needs a package that the rest does without.
            from hsplat_cli.compare.comparison_html import comparison_page

            texts[self.html] = comparison_page(comparison, gallery)
        with staged_files() as write:
            for path, text in texts.items():
                write(path, text.encode())

    def write_failure(self, golden: str, actual: str, why: str) -> None:
        """Write that there was no comparison, and why, where JSON or JUnit is asked for."""
        failure = Failure(golden, actual, why)
        with staged_files() as write:
            if self.json is not None:
                write(self.json, failure_json(failure).encode())
            if self.junit is not None:
                write(self.junit, failure_junit(failure).encode())


def run_comparison(
    pairs: PairSource, rules: Rules, *, golden: str, actual: str, reports: ReportFiles, quiet: bool
) -> Comparison:
    """Judge all pairs and write the reports.

    golden, actual: as in Comparison. Raises InputError where a frame cannot be compared; no report is written then.
    """
    rules.require_frames(pairs.names)
    gallery = Gallery()
    with progress(len(pairs.names), label="comparing", quiet=quiet) as done:

        def see(outcome: Outcome, pair: Pair) -> None:
            if reports.html is not None:
                gallery.add(outcome, pair)
            done.advance()

        outcomes = judge(pairs, rules, see)
    comparison = Comparison(
        golden, actual, rules.level, outcomes, [*pairs.notes, *rules.notes], pairs.facts, rules.other_limits
    )
    reports.write(comparison, gallery)
    return comparison
