"""One step in time does not stand for all: looks, windows and labels are those of several, or of all."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from kinds_of_data import ball, extinction

from renderer.readers import read_volume
from renderer.resolve import resolve_scene
from renderer.scene import FileSource, LabelsSpec, VolumeSpec, parse_scene
from renderer.suggest import VolumeSuggestion, Wish, suggest_for
from renderer.volume import Array, Channel, Volume, make_volume

BALL = ball((0.0, 0.0, 0.0), 0.5)


def bright(values: Array, level: float, noise: float = 2.0) -> Array:
    """Return a ball and a denser bar of a level, in noise around 0."""
    random = np.random.default_rng(0).normal(0, noise, values.shape)
    body = level * (0.6 * BALL + 0.4 * (BALL & (np.abs(np.linspace(-1, 1, len(BALL))) < 0.1)))
    return np.abs(body + random).astype(np.float32)


def suggested(*steps: Array, names: Any = None, channels: tuple[Channel, ...] = ()) -> VolumeSuggestion:
    """Return what is suggested for steps in time, of each of which [z, y, x] or [channel, z, y, x] are the values."""

    def read(spec: VolumeSpec) -> Volume:
        step = spec.time if isinstance(spec.time, int) else 0
        component = spec.component if isinstance(spec.component, int) else 0
        values = np.array(steps[step][component] if channels else steps[step])
        return replace(make_volume(values, np.eye(4), f"step {step}"), num_times=len(steps), channels=channels)

    return suggest_for(VolumeSpec(FileSource(Path("film.nii"))), read)


def test_a_look_shows_the_steps_whose_levels_differ() -> None:
    """A first picture is 25 times as bright as those that follow, as of labelled spins of blood."""
    steps = [bright(BALL, level) for level in (1000, 40, 40)]
    found = suggested(*steps)
    assert found.volume.time == "auto"
    of_air, of_dim, of_bright = extinction(found.suggestion.transfer, 1, 38, 900)
    assert of_air == 0 < min(of_dim, of_bright)
    assert not found.suggestion.outlier_notes


def test_steps_that_the_look_cannot_show_are_told() -> None:
    """The noise of the first step hides what the others show: no look shows both, and the brightest counts."""
    steps = [bright(BALL, 1000, noise=30), bright(BALL, 12, noise=0.2), bright(BALL, 12, noise=0.2)]
    (note,) = suggested(*steps).suggestion.outlier_notes
    assert note == "steps 1 and 2 of 3 show next to nothing with this look"


def test_an_empty_step_changes_no_look() -> None:
    """A dye flows in: there is noise alone at first, and its look is no look of the others."""
    empty, full = bright(BALL, 0), bright(BALL, 1000)
    found, alone = suggested(empty, full, full), suggested(full, full)
    assert found.suggestion.transfer == alone.suggestion.transfer
    assert found.suggestion.outlier_notes == ("step 0 of 3 shows next to nothing with this look",)


def test_labels_are_those_of_all_steps() -> None:
    """The seventh of nine steps alone has label 5; every other step, of which some are read, has labels 1 and 9."""
    first = np.zeros((24, 24, 24), np.uint8)
    first[4:10, 4:10, 4:10], first[14:20, 14:20, 14:20] = 1, 9
    steps = [first.copy() for _ in range(9)]
    steps[6][4:10, 14:20, 4:10] = 5
    labels = suggested(*steps).suggestion.transfer.labels
    assert labels is not None and labels.values == (1, 5, 9)
    assert len({style.color for style in labels.styles}) == 3


def test_windows_of_channels_are_those_of_the_brightest_steps() -> None:
    """One channel fades while the other one rises."""
    steps = [np.stack([bright(BALL, first), bright(BALL, last)]) for first, last in ((1000, 50), (500, 500), (50, 900))]
    lights = (Channel("a", is_light=True), Channel("b", is_light=True))
    found = suggested(*steps, channels=lights)
    highs = [layer.range[1] for layer in found.layers if layer.range is not None]
    assert [layer.volume.time for layer in found.layers] == ["auto", "auto"]
    assert min(highs) > 500


TABLE = '0 0 0 0 0 0 0 "air"\n1 255 0 0 1 1 1 "bone"\n2 0 255 0 1 0 1 "hidden"\n3 0 0 255 0.25 1 1 "glass"\n'


@pytest.mark.usefixtures("folder")
def test_a_suggestion_obeys_a_table_as_a_scene_does() -> None:
    """ITK-SNAP's table says which labels are visible (VIS), and how opaque they are (the fifth column)."""
    values = np.zeros((24, 24, 24), np.uint8)
    for label, place in ((1, 3), (2, 10), (3, 17)):
        values[8:14, 8:14, place : place + 5] = label
    np.save("seg.npy", values)
    Path("seg.label").write_text(TABLE)
    found = suggest_for(VolumeSpec(FileSource(Path("seg.npy"))), read_volume)
    labels = found.suggestion.transfer.labels
    given = {"volume": {"file": "seg.npy"}, "labels": {}, "output": {"file": "a.png"}}
    camera = {"camera": {"path": {"type": "turntable", "frames": 1}}}
    scene = resolve_scene(parse_scene({"version": 1} | given | camera, base=Path()), read_volume)
    resolved = scene.layers[0].transfer_function.labels
    assert labels is not None and resolved is not None
    assert labels.values == resolved.values == (1, 3)
    assert [style.color for style in labels.styles] == [style.color for style in resolved.styles]
    assert [style.name for style in labels.styles] == ["bone", "glass"]
    assert labels.styles[1].opacity == resolved.styles[1].opacity == 0.25 < labels.styles[0].opacity
    assert found.suggestion.outlier_notes == ("the table of labels hides hidden",)
    assert [layer.name for layer in found.suggestion.visible] == ["bone", "glass"]
    plain = suggest_for(VolumeSpec(FileSource(Path("seg.npy"))), read_volume, wish=Wish(colormap="viridis"))
    assert isinstance(plain.suggestion.transfer.mapping, LabelsSpec)
    assert plain.suggestion.transfer.mapping.colors != labels.colors
