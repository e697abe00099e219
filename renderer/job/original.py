"""Describe a film that is made again from its sidecar."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # records take a while to load, and the job of a scene needs none before it draws
    from renderer.job.record import FilmRecord


@dataclass(frozen=True)
class OriginalFilm:
    """A film that is made again, perhaps with changes.

    path: of its sidecar. keeps_accuracy: whether what was measured of it holds for the new film, too.
    keeps_versions: whether the same bytes are expected, so that other versions are told.
    """

    path: Path
    record: FilmRecord
    keeps_accuracy: bool = True
    keeps_versions: bool = True

    @property
    def frames_digest(self) -> str | None:
        """Return the digest of what its frames depended on; None for a film that one pass would not have made."""
        return None if self.record.fingerprint is None else self.record.fingerprint.frames_digest

    @property
    def tools(self) -> dict[str, Any]:
        """Return the versions of what made it by name, with `device` and `sources`; none where they do not count."""
        if not self.keeps_versions:
            return {}
        found = {**self.record.versions, "device": self.record.device}
        sources = self.record.fingerprint and self.record.fingerprint.depends_on.get("sources")
        return found | ({"sources": sources} if isinstance(sources, str) else {})
