"""How the frames of a job get their tolerances."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from renderer.errors import RenderError
from renderer.frame import Stage, ToleranceController

if TYPE_CHECKING:
    from renderer.study import ToleranceSearchResult


@dataclass(frozen=True)
class FilmPlan:
    """How frames get their tolerances: from the schedule of the stage's scene, whose goal is resolved, or from a guide.

    shortfall: what was asked for and cannot be had; what is drawn then is the best there is.
    is_unfinished: finer passes are to follow.
    is_timing_dependent: its tolerances depend on how quick the machine was.
    found: what the search for an accuracy came to.
    """

    stage: Stage
    controller: ToleranceController | None = None
    shortfall: RenderError | None = None
    is_unfinished: bool = False
    is_timing_dependent: bool = False
    found: ToleranceSearchResult | None = None
