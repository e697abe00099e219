"""Write the reports of a comparison."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hsplat_cli.compare.gallery import Gallery
from hsplat_cli.compare.outcome import Comparison
from hsplat_cli.compare.rules import LIMITS_FILE
from hsplat_cli.compare.text_reports import comparison_json, comparison_junit, failure_json, failure_junit
from renderer.errors import HsplatError, InputError, require_package
from renderer.film import require_no_input, require_writable, shorten_paths, staged_files, translate_os_errors
from renderer.scene import MAX_SIDECAR_BYTES, read_json_object

# No frame or scene file has these suffixes, so that a typing mistake overwrites none of them.
_SUFFIXES = {"--json": (".json",), "--junit": (".xml",), "--html": (".html", ".htm")}


@dataclass(frozen=True)
class ReportFiles:
    """The paths of the requested reports, by option.

    private: inputs whose folders, and those of the limits beside them, the reports leave out.
    """

    paths: Mapping[str, Path]
    private: Sequence[Path] = ()

    def require_names(self, inputs: Iterable[Path]) -> None:
        """Raise InputError if a name has a wrong suffix, or is that of an input or a sidecar. Write nothing."""
        for option, path in self.paths.items():
            where, suffixes = f"{option} {path}", _SUFFIXES[option]
            if path.suffix.lower() not in suffixes:
                got = f"a {path.suffix} file" if path.suffix else "no suffix"
                raise InputError("not a name for a report", where=where, got=got, expected=f"a {suffixes[0]} file")
            if os.path.exists(path) and not os.path.isfile(path):  # a device, or a pipe
                got = "a folder" if os.path.isdir(path) else "a special file"
                raise InputError("a report cannot replace this", where=where, got=got)
        require_no_input(self.paths.values(), inputs)
        record = self.paths.get("--json")
        if record is not None and "scene" in (read_json_object(record, MAX_SIDECAR_BYTES) or {}):
            raise InputError(
                "this report would overwrite the record of a scene",
                where=f"--json {record}",
                got="the JSON file of a film, of goldens or of a study",
                hint="give the report another name",
            )

    def prepare(self) -> None:
        """Remove the reports of an earlier comparison, which would be wrong if this one fails; create missing folders.

        Raises InputError or RenderError if one of them cannot be written.
        """
        for path in self.paths.values():
            with translate_os_errors(path):
                path.unlink(missing_ok=True)
        for path in self.paths.values():
            require_writable(path)
        if "--html" in self.paths:
            require_package("jinja2", extra="compare")

    def write(self, comparison: Comparison, gallery: Gallery) -> None:
        """Write all reports, or none."""
        texts = {key: getattr(comparison, key) for key in ("golden", "actual", "notes", "other_limits")}
        comparison = replace(comparison, **self._shorten(texts))

        def page() -> str:
            # Imported here because only this report needs jinja2.
            from hsplat_cli.compare.comparison_html import comparison_page

            return comparison_page(comparison, gallery)

        json, junit = (lambda: comparison_json(comparison)), (lambda: comparison_junit(comparison))
        self._write({"--json": json, "--junit": junit, "--html": page})

    def write_failure(self, golden: Path, actual: Path, error: Exception) -> None:
        """Report in JSON and JUnit, where requested, why nothing was compared."""
        texts = [str(golden), str(actual), str(error)]
        if not isinstance(error, HsplatError):
            texts[-1] = f"{type(error).__name__}: {error}"
        if self.private:
            texts[-1] = error.summary if isinstance(error, HsplatError) else type(error).__name__
            texts = self._shorten(texts)
        self._write({"--json": lambda: failure_json(*texts), "--junit": lambda: failure_junit(*texts)})

    def _shorten(self, texts: Any) -> Any:
        limits = [path.parent / LIMITS_FILE for path in self.private]  # which notes and other limits name
        return shorten_paths(texts, [*self.private, *limits])

    def _write(self, texts: Mapping[str, Callable[[], str]]) -> None:
        with staged_files() as write:
            for option, path in self.paths.items():
                if option in texts:
                    write(path, texts[option]().encode())
