"""Suggest a look that suits all steps in time of a volume.

A look made from one step may show nothing in other steps, or show their air. So several steps are read, and a look is
made from each: with all of its values, and without the values that are background in any step. Each look is tried on
all steps, along the same rays, and the look that suits most steps is taken.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from renderer.readers import ReadVolume, some_steps
from renderer.scene import ColormapSpec, LabelsSpec, OverFrames, VolumeSpec, steps_in_time
from renderer.statistics import (
    Background,
    Statistics,
    VoxelSample,
    find_background,
    read_labels,
    sample_volume,
    without_padding,
)
from renderer.suggest.opacity_calibration import depths_along
from renderer.suggest.suggestion import LEAST_OPACITY, Suggestion, transparent_between, with_points
from renderer.suggest.turntable_rays import TurntableRays, cast_rays
from renderer.suggest.volume_suggestion import VolumeSuggestion, read_in_colors, suggest_read
from renderer.suggest.wishes import Wish
from renderer.transfer import make_transfer_function
from renderer.volume import Float64, Volume

# A look suits a step only if the mean opacity of the step's rays is at least this part of the opacity that the step's
# own look gives them.
_LEAST_SHOWN = 0.1
# A look suits a step only if the share of the border's voxels that is visible, which should be air, is at most this
# much larger with the look than with the step's own look.
_MOST_AIR = 0.02
# A step is reported as showing next to nothing if its mean opacity is less than this part of the most opaque step's.
_NEXT_TO_NOTHING = 0.05


@dataclass(frozen=True)
class _Step:
    """A step in time: the look suggested for it, and measurements that tell whether another look suits it.

    number: the number of the step.
    found: the suggested look.
    span: the width of the range of the step's values.
    rays: the step's values along rays.
    sample: a sample of the step that has lost its voxels, and only serves to normalise values.
    border: the values on the volume's faces.
    background: the background of this step, normalised.
    """

    number: int
    found: VolumeSuggestion
    span: float
    rays: TurntableRays
    sample: VoxelSample
    border: Float64
    background: Background

    def shown(self, look: Suggestion) -> float:
        """Return the mean opacity that a look gives to the step's rays."""
        depths = depths_along(look.transfer, self.sample, self.rays, self.sample.diagonal).sum(axis=1)
        return float(-np.expm1(-depths.astype(np.float64)).mean())

    def air_shown(self, look: Suggestion) -> float:
        """Return the share of the voxels on the volume's faces that are visible with a look."""
        transfer = make_transfer_function(look.transfer, min(self.sample.spacing))
        return float(np.mean(transfer.classify(self.border)[1] * transfer.unit > LEAST_OPACITY))


def suggest_in_time(volume: OverFrames[VolumeSpec], read: ReadVolume, wish: Wish) -> VolumeSuggestion:
    """Suggest a look for all steps in time that a film shows of a volume: one that suits as many as possible."""
    all_steps = steps_in_time(volume)
    if len(all_steps) == 1:
        return suggest_read(*_read(volume.at(0), read, wish), wish)
    steps = [_look_at(all_steps[k], read, wish) for k in some_steps(len(all_steps))]
    widest = max(steps, key=lambda step: step.span)
    if widest.found.suggestion.transfer.labels is not None:
        spec, labels, statistics = _read(replace(volume.at(0), time=widest.number), read, wish)
        of_all = volume.map(lambda each: replace(spec, time=each.time))
        known = partial(read_labels, of_all, read, LabelsSpec())
        return suggest_read(spec, labels, statistics, wish, known)
    chosen, look = _most_suitable(steps, widest)
    which, num = f"step {chosen.number} of {len(all_steps)}", len(steps)
    why = f"{which} has the widest range of {num} that were read"
    if chosen is not widest:
        why = f"the look is that of {which}, which suits most of {num} that were read"
    shown = {step.number: step.shown(look) for step in steps}
    dim = [str(number) for number, part in shown.items() if part < _NEXT_TO_NOTHING * max(shown.values())]
    note = f"{_counted_steps(dim)} of {len(all_steps)} {'shows' if len(dim) == 1 else 'show'} next to nothing"
    notes = (*look.outlier_notes, *[f"{note} with this look"] * bool(dim))
    return replace(chosen.found, suggestion=replace(look, reason=f"{look.reason}; {why}", outlier_notes=notes))


def _counted_steps(numbers: Sequence[str]) -> str:
    """Return the numbers of steps in words: `step 3`, or `steps 0, 3 and 7`."""
    *others, last = numbers or [""]
    return f"steps {', '.join(others)} and {last}" if others else f"step {last}"


def _read(spec: VolumeSpec, read: ReadVolume, wish: Wish) -> tuple[VolumeSpec, Volume, Statistics]:
    return read_in_colors(spec, read(spec), read, wish)


def _look_at(spec: VolumeSpec, read: ReadVolume, wish: Wish) -> _Step:
    number = spec.time
    assert isinstance(number, int)
    spec, volume, statistics = _read(spec, read, wish)
    found = suggest_read(spec, volume, statistics, wish)
    shown = statistics.without_outliers or statistics
    if shown.minimum == shown.maximum:  # values cannot be normalised by a range of 0
        shown = replace(shown, minimum=shown.minimum - max(1, abs(shown.minimum)))
    sample = without_padding(sample_volume(volume, shown))
    span, (border, _), empty = sample.maximum - sample.minimum, sample.valid_values(), np.empty((0, 0, 0))
    return _Step(
        number=number,
        found=found,
        span=span,
        rays=cast_rays(sample),
        sample=replace(sample, normalized=empty, neighbours=empty, is_valid=empty > 0),
        border=sample.minimum + span * border,
        background=find_background(sample),
    )


def _most_suitable(steps: Sequence[_Step], widest: _Step) -> tuple[_Step, Suggestion]:
    """Return the step whose look suits most steps, and this look. If several suit equally many, `widest` comes first.

    widest: the step with the widest range of values. Steps without a background are left out, because nothing tells the
    object from its surroundings there.
    """
    backed = [step for step in steps if step.background.is_there]
    own = [(step.shown(step.found.suggestion), step.air_shown(step.found.suggestion)) for step in backed]

    def num_unsuited(look: Suggestion) -> tuple[int, int]:
        pairs = [*zip(backed, own, strict=True)]
        num_airy = sum(step.air_shown(look) > air + _MOST_AIR for step, (_, air) in pairs)
        return num_airy, sum(step.shown(look) < _LEAST_SHOWN * shown for step, (shown, _) in pairs)

    tried = [widest, *(step for step in backed if step is not widest)]
    looks = [(step, look) for step in tried for look in _looks_of(step, backed)]
    return min(looks, key=lambda pair: num_unsuited(pair[1]))


def _looks_of(step: _Step, backed: Sequence[_Step]) -> Iterator[Suggestion]:
    """Yield the look of a step, and the same look without the values that are background in any step."""
    look = step.found.suggestion
    yield look
    if look.transfer.points and not isinstance(look.transfer.mapping, ColormapSpec) and backed:
        ends = [
            (each.sample.denormalize(ground.low), each.sample.denormalize(ground.high))
            for each in backed
            for ground in [each.background]
        ]
        low, high = min(low for low, _ in ends), max(high for _, high in ends)
        yield with_points(look, transparent_between(look.transfer.points, low, high))
