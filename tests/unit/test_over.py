"""A volume over another one: exact rays see both, and notes say where volumes lie."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kinds_of_data import ball, volume_of

from renderer.errors import SceneError
from renderer.frame import prepare_stage, view_of
from renderer.layers import placement_notes
from renderer.scene import (
    ControlPoint,
    FileSource,
    LabelsSpec,
    LayerSpec,
    Scene,
    ShadingSpec,
    SharedKeys,
    TransferSpec,
    VolumeSpec,
    parse_scene,
)
from renderer.suggest import UPPER_SHARE, VolumeSuggestion, Wish, balance, suggest_over
from renderer.truth import SceneRays, pixel_centres
from renderer.volume import Array, Volume, make_volume

UPPER, LOWER = VolumeSpec(FileSource(Path("upper.npy"))), VolumeSpec(FileSource(Path("lower.npy")))


def noisy(inside: Array, seed: int = 0) -> Array:
    """Return a scan: 1000 inside of something, 100 outside, with noise."""
    noise = np.random.default_rng(seed).normal(0.0, 8.0, inside.shape)
    return (100 + 900 * inside + noise).astype(np.float32)


def placed(
    values: Array, spacing: float = 1.0, centre: tuple[float, float, float] = (0, 0, 0), turn: float = 0.0
) -> Volume:
    """Return a volume around a place in the world, turned about z."""
    affine = np.eye(4)
    affine[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    affine[:3, :3] *= spacing
    affine[:3, 3] = centre - affine[:3, :3] @ ((np.array(values.shape[::-1]) - 1) / 2)
    return make_volume(np.ascontiguousarray(values), affine, "made up")


def over(upper: Volume, lower: Volume, wish: Wish | None = None) -> tuple[VolumeSuggestion, VolumeSuggestion]:
    volumes = {UPPER.source: upper, LOWER.source: lower}
    return suggest_over(UPPER, LOWER, lambda spec: volumes[spec.source], **({} if wish is None else {"wish": wish}))


def exact_share(found: tuple[VolumeSuggestion, VolumeSuggestion], volumes: tuple[Volume, Volume]) -> float:
    """Return the upper volume's part of what exact rays show where both are met: it is red, the other one blue."""
    layers = []
    for each, color in zip(found, ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)), strict=True):
        transfer, shading = each.suggestion.transfer, each.suggestion.shading
        assert shading is not None
        look: tuple[ControlPoint, ...] | LabelsSpec = tuple(replace(point, color=color) for point in transfer.points)
        if (labels := transfer.labels) is not None:
            look = replace(labels, colors=tuple((value, color) for value in labels.values))
        transfer = replace(transfer, mapping=look)
        even = ShadingSpec(ambient=1.0, diffuse=0.0, gradient_opacity=shading.gradient_opacity)
        layers.append(LayerSpec(each.volume, transfer, even, each.suggestion.clip, weight=each.weight))
    scene = replace(scene_of(), layers=tuple(layers), shared=SharedKeys())
    with prepare_stage(scene, clock=lambda: 0.0, num_threads=2, volumes=volumes) as stage:
        rays, places = SceneRays(stage), pixel_centres(scene.output.size)
        colors = np.concatenate([rays.integrate(view_of(stage, frame), places, 0.5) for frame in range(4)])
    red, blue = colors[:, 0], colors[:, 2]
    are_both = (red > 0.02) & (blue > 0.02)
    return float(red[are_both].sum() / (red + blue)[are_both].sum())


def scene_of() -> Scene:
    tree = {
        "volume": {"procedural": {"name": "constant", "shape": [4, 4, 4]}},
        "transfer_function": {"points": [{"value": 0, "color": "white", "opacity": 1}]},
        "camera": {"target": "visible", "path": {"type": "turntable", "frames": 4, "elevation": 20}},
        "output": {"file": "{frame}.png", "size": [48, 48], "background": "black"},
    }
    return parse_scene(tree, base=Path())


@pytest.mark.parametrize("depths", [(50.0, 50.0), (2.0, 3.0), (0.5, 40.0)])
@pytest.mark.parametrize("share", [0.5, UPPER_SHARE, 0.9])
def test_balance_of_two_slabs_is_that_of_lamberts_law(depths: tuple[float, float], share: float) -> None:
    """The second slab is in front: it takes its opacity, and the first one what is left."""
    weights = np.array([[[0.0, depths[0]]], [[depths[1], 0.0]]], np.float32)
    one, other = balance(weights, share)
    front = -np.expm1(-depths[1] * other)
    behind = -np.expm1(-depths[0] * one) * (1 - front)
    assert behind / (front + behind) == pytest.approx(share, abs=1e-4)
    assert (one == 1 and 0 < other <= 8) or (one < 1 and other == pytest.approx(8))


@pytest.mark.parametrize(
    ("spacing", "centre", "turn"), [(1.0, (0.0, 0.0, 0.0), 0.0), (0.4, (4.0, -6.0, 3.0), 0.6)], ids=["same", "small"]
)
def test_exact_rays_show_the_upper_volume_as_solved(
    spacing: float, centre: tuple[float, float, float], turn: float
) -> None:
    """A box within a ball, on a grid of its own."""
    box = np.zeros((40, 40, 40), bool)
    box[10:30, 12:28, 8:32] = True
    upper, lower = placed(noisy(box), spacing, centre, turn), placed(noisy(ball((0, 0, 0), 0.8), 1), 1.0, (0, 0, 0))
    found = over(upper, lower)
    assert found[0].weight == 1
    assert exact_share(found, (upper, lower)) == pytest.approx(UPPER_SHARE, abs=0.05)


def test_a_volume_around_the_other_one_becomes_translucent() -> None:
    upper, lower = (placed(noisy(ball((0, 0, 0), 0.8)), spacing) for spacing in (1.0, 0.5))
    found = over(upper, lower)
    assert found[0].weight < 1 < found[1].weight
    assert exact_share(found, (upper, lower)) == pytest.approx(UPPER_SHARE, abs=0.05)


def chromas(transfer: TransferSpec) -> list[float]:
    assert isinstance(transfer.mapping, tuple)
    return [max(point.color) - min(point.color) for point in transfer.mapping]


def test_colors_are_told_apart() -> None:
    upper, lower = (placed(noisy(ball((0, 0, 0), 0.8)), spacing) for spacing in (0.5, 1.0))
    warm, grey = (each.suggestion.transfer for each in over(upper, lower))
    assert min(chromas(warm)) > 0.3 and max(chromas(grey)) == 0
    assert isinstance(warm.mapping, tuple) and all(r > g > b for r, g, b in (p.color for p in warm.mapping))
    wished = over(upper, lower, Wish("viridis"))[0].suggestion.transfer.mapping
    assert not isinstance(wished, tuple) and wished.colormap == "viridis"


@pytest.mark.parametrize("is_upper", [True, False])
def test_labels_keep_their_colors_and_exact_rays_show_them_as_solved(*, is_upper: bool) -> None:
    values = np.zeros((40, 40, 40), np.uint8)
    values[8:20, 8:30, 8:30], values[22:34, 8:30, 8:20], values[22:34, 8:30, 22:30] = 3, 7, 9
    values[1:4, 1:4, 1:4] = 5
    labels, other = placed(values, 1.0, (0, 0, 0)), placed(noisy(ball((0, 0, 0), 0.9)), 0.5 + is_upper, (0, 0, 0))
    volumes = (labels, other) if is_upper else (other, labels)
    found = over(*volumes)
    chosen = found[not is_upper].suggestion.transfer.labels
    assert chosen is not None and chosen.values == (3, 5, 7, 9)
    assert len({style.color for style in chosen.styles}) == 4
    assert exact_share(found, volumes) == pytest.approx(UPPER_SHARE, abs=0.05)


def test_volumes_beside_each_other_keep_their_densities() -> None:
    one, other = (placed(noisy(ball((0, 0, 0), 0.5)), 1.0, (0, 0, z)) for z in (0.0, 500.0))
    found = over(one, other)
    assert [each.weight for each in found] == [1, 1]
    shading = found[1].suggestion.shading
    assert shading is not None and shading.gradient_opacity is None


@pytest.mark.parametrize("which", [0, 1])
def test_a_constant_volume_can_be_one_of_two(which: int) -> None:
    volumes = [volume_of(np.full((8, 8, 8), 5.0)), volume_of(noisy(ball((0, 0, 0), 0.8)))]
    assert len(over(*volumes[:: 1 - 2 * which])) == 2


def layers_of(*names: str) -> list[LayerSpec]:
    transfer = scene_of().layers[0].transfer_function
    return [LayerSpec(UPPER, transfer, name=name) for name in names]


def test_volumes_that_overlap_no_other_are_told() -> None:
    volumes = [placed(np.zeros((4, 4, 4)), 1.0, (x, 0.0, 0.0)) for x in (0.0, 3.9, 8.0)]
    told = list(placement_notes(layers_of("", "", "far"), volumes))
    assert told == ["far overlaps no other volume: it reaches from [6, -2, -2] to [10, 2, 2]"]
    assert not list(placement_notes(layers_of(""), volumes[:1]))


@pytest.mark.parametrize(("spacing", "is_right"), [(290.0, True), (310.0, False), (1 / 290, True), (1 / 310, False)])
def test_worlds_of_other_units_are_refused(spacing: float, is_right: bool) -> None:
    one = placed(np.eye(4)[None].repeat(4, 0), 1.0, (0, 0, 0))
    volumes = [one, placed(one.values, spacing, (0, 0, 0))]
    scene = replace(scene_of(), layers=tuple(layers_of("one", "other")), shared=SharedKeys())
    if is_right:
        prepare_stage(scene, clock=lambda: 0.0, num_threads=1, volumes=volumes).close()
        return
    with pytest.raises(SceneError, match=r"volumes\.1: this volume is 310 times as (large|small) as the first"):
        prepare_stage(scene, clock=lambda: 0.0, num_threads=1, volumes=volumes)
