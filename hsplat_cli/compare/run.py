"""Run a comparison and write its reports."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hsplat_cli.compare.gallery import Gallery
from hsplat_cli.compare.judge import compare_pairs
from hsplat_cli.compare.outcome import Comparison, Outcome
from hsplat_cli.compare.pair import Pair, Pairs
from hsplat_cli.compare.rules import Rules
from hsplat_cli.compare.text_reports import comparison_json, comparison_junit, failure_json, failure_junit
from hsplat_cli.terminal import Reporter
from renderer.errors import InputError, require_package
from renderer.film import require_writable, staged_files, translate_os_errors
from renderer.scene import is_same_file

# No frame, scene or volume has these suffixes, so that a typing mistake overwrites none of them.
_SUFFIXES = {"--json": (".json",), "--junit": (".xml",), "--html": (".html", ".htm")}


@dataclass(frozen=True)
class ReportFiles:
    """The requested reports; None for the others."""

    json: Path | None = None
    junit: Path | None = None
    html: Path | None = None

    @property
    def paths(self) -> dict[str, Path]:
        """The paths of the requested reports, by option."""
        given = {"--json": self.json, "--junit": self.junit, "--html": self.html}
        return {option: path for option, path in given.items() if path is not None}

    def require_names(self, inputs: Sequence[Path]) -> None:
        """Raise InputError if a name has a wrong suffix, or is an existing input. Write nothing."""
        for option, path in self.paths.items():
            where, suffixes = f"{option} {path}", _SUFFIXES[option]
            if path.suffix.lower() not in suffixes:
                got = f"a {path.suffix} file" if path.suffix else "no suffix"
                raise InputError("not a name for a report", where=where, got=got, expected=f"a {suffixes[0]} file")
            if os.path.exists(path) and not os.path.isfile(path):  # a device, or a pipe
                got = "a folder" if os.path.isdir(path) else "a special file"
                raise InputError("a report cannot replace this", where=where, got=got)
            if any(is_same_file(path, other) for other in inputs):
                raise InputError("a report would overwrite an input of the comparison", where=where)

    def prepare(self) -> None:
        """Remove the reports of an earlier comparison, which would be wrong if this one fails; create missing folders.

        Raises InputError or RenderError if one of them cannot be written.
        """
        for path in self.paths.values():
            with translate_os_errors(path):
                path.unlink(missing_ok=True)
        for path in self.paths.values():
            require_writable(path)
        if self.html is not None:
            require_package("jinja2", extra="compare")

    def write(self, comparison: Comparison, gallery: Gallery) -> None:
        """Write all reports, or none."""
        texts: dict[Path, str] = {}
        if self.json is not None:
            texts[self.json] = comparison_json(comparison)
        if self.junit is not None:
            texts[self.junit] = comparison_junit(comparison)
        if self.html is not None:
            # Imported here because only this report needs jinja2.
            from hsplat_cli.compare.comparison_html import comparison_page

            texts[self.html] = comparison_page(comparison, gallery)
        with staged_files() as write:
            for path, text in texts.items():
                write(path, text.encode())

    def write_failure(self, golden: str, actual: str, why: str) -> None:
        """Report in JSON and JUnit, where requested, why nothing was compared."""
        with staged_files() as write:
            if self.json is not None:
                write(self.json, failure_json(golden, actual, why).encode())
            if self.junit is not None:
                write(self.junit, failure_junit(golden, actual, why).encode())


def run_comparison(
    pairs: Pairs, rules: Rules, reports: ReportFiles, reporter: Reporter, *, golden: str, actual: str
) -> Comparison:
    """Compare all pairs and write the reports.

    golden, actual: as in Comparison. Raises InputError, before any report is written, if a frame cannot be compared.
    """
    rules.require_frames(pairs.names)
    gallery = Gallery()
    with reporter.progress(len(pairs.names), label="comparing") as bar:

        def on_outcome(outcome: Outcome, pair: Pair) -> None:
            if reports.html is not None:
                gallery.add(outcome, pair)
            bar.advance()

        outcomes = compare_pairs(pairs.read(), rules, on_outcome)
    comparison = Comparison(
        golden, actual, rules.level, outcomes, [*pairs.notes, *rules.notes], pairs.facts, rules.other_limits
    )
    reports.write(comparison, gallery)
    return comparison
