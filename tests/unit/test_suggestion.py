"""Each kind of data is recognised, and its suggestion shows it."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from kinds_of_data import (
    KINDS,
    N,
    axes,
    ball,
    blurred,
    extinction,
    head_in_hounsfield_units,
    labels,
    noise,
    signed,
    suggested,
    two_materials,
    volume_of,
)

from renderer.readers import read_volume
from renderer.scene import ColormapSpec, FileSource, LabelsSpec, VolumeSpec, colormap_points
from renderer.statistics import compute_statistics, hounsfield_zero
from renderer.suggest import Wish, suggest
from renderer.transfer import make_transfer_function

Array = npt.NDArray[Any]


@pytest.mark.parametrize("name", KINDS)
def test_kind(name: str) -> None:
    values, kind = KINDS[name]
    assert suggested(values).kind == kind


def test_a_constant_volume_is_shown_through_and_through() -> None:
    (depth,) = extinction(suggested(np.full((16, 16, 16), 3.0)).transfer, 3.0)
    assert 0.2 < -np.expm1(-depth * 16) < 0.9


@pytest.mark.parametrize("name", ["head", "signed", "labels", "density"])
def test_the_size_of_the_volume_does_not_matter(name: str) -> None:
    """The same object of three times as many voxels along each axis, each as much smaller, has the same opacities per
    length, within what the edges of a sample of voxels may change."""
    factor = 3
    values = KINDS[name][0][:32, :32, :32]
    coarse = suggested(values)
    fine = suggested(values.repeat(factor, 0).repeat(factor, 1).repeat(factor, 2), 1 / factor)
    at = np.percentile(values, [1, 50, 90, 99, 99.9]).tolist()
    assert fine.kind == coarse.kind
    np.testing.assert_allclose(
        extinction(fine.transfer, *at, spacing=1 / factor), extinction(coarse.transfer, *at), rtol=0.25, atol=1e-2
    )


@pytest.mark.parametrize("name", ["uint8", "labels"])
@pytest.mark.parametrize("scale", [1e-20, 1e-3, 1e25])
def test_the_unit_of_length_does_not_matter(name: str, scale: float) -> None:
    """A scene in other units of length has the same depths: opacities by a length that is as many times longer."""
    values = KINDS[name][0]
    here, there = suggested(values), suggested(values, scale)
    at = np.percentile(values, [50, 99, 100]).tolist()
    # Opacities are written with three digits.
    np.testing.assert_allclose(
        np.array(extinction(there.transfer, *at, spacing=scale)) * scale,
        extinction(here.transfer, *at),
        rtol=0.02,
        atol=1e-6,
    )


@pytest.mark.parametrize(("scale", "offset"), [(1e-30, 0.0), (1e-12, 3e-9), (1e30, 0.0), (0.001, -7.0), (1e300, 1e302)])
def test_the_unit_of_the_values_does_not_matter(scale: float, offset: float) -> None:
    """Values that are scaled and shifted, in float64: the same look, at values that are scaled and shifted.

    The control values are rounded to thousandths of the range, and opacities follow where they are.
    """
    values = np.asarray(KINDS["dark object"][0], np.float64) + 0.25
    here, there = suggested(values), suggested(values * scale + offset)
    at = np.percentile(values, [1, 5, 20, 50, 99])
    np.testing.assert_allclose(
        extinction(there.transfer, *(at * scale + offset).tolist()),
        extinction(here.transfer, *at.tolist()),
        rtol=0.05,
        atol=2e-3,
    )


@pytest.mark.parametrize("name", KINDS)
@pytest.mark.parametrize("colormap", [None, "viridis"])
def test_points_ascend_and_the_background_is_clear(name: str, colormap: str | None) -> None:
    values, kind = KINDS[name]
    transfer = suggested(values, colormap=colormap).transfer
    mapping = transfer.mapping
    if isinstance(mapping, ColormapSpec):
        at = [value for value, _ in mapping.opacity]
        assert colormap in (None, mapping.colormap) and mapping.range[0] < mapping.range[1]
    elif isinstance(mapping, LabelsSpec):
        at = [*mapping.values]
        table = colormap_points(colormap, max(2, len(at))) if colormap else [color for _, color in mapping.colors]
        assert [style.color for style in mapping.styles] == list(table)[: len(at)]
    else:
        at = [point.value for point in mapping]
        assert colormap is None
    assert all(low <= high for low, high in pairwise(at))
    assert extinction(transfer, *np.unique(values).tolist())
    if kind not in ("constant volume", "two phases", "filled volume", "field with two signs"):
        corner = float(np.median([values[0, 0, 0], values[-1, 0, 0], values[0, -1, -1]]))
        assert extinction(transfer, corner) == [0.0]


def test_hounsfield_units_are_recognised_by_their_peaks() -> None:
    head = head_in_hounsfield_units()
    assert hounsfield_zero(compute_statistics(head)) == 0
    assert hounsfield_zero(compute_statistics(np.ascontiguousarray(head[:, :, 10:-10]))) == 0  # no padding
    assert hounsfield_zero(compute_statistics((np.maximum(head, -1000) + 1000).astype(np.uint16))) in (1000, 1024)
    # Other values of the same range: twice as far apart, even ones, those of a seismic survey.
    assert hounsfield_zero(compute_statistics((head // 2).astype(np.int16))) is None
    assert hounsfield_zero(compute_statistics(np.linspace(-1024, 3071, 10_000))) is None
    normal = np.random.Generator(np.random.PCG64(1)).normal(0, 700, 100_000)
    assert hounsfield_zero(compute_statistics(normal.astype(np.int16))) is None


def test_padding_is_not_seen() -> None:
    transfer = suggested(head_in_hounsfield_units()).transfer
    assert extinction(transfer, -3024, -1024, -1000, -400) == [0, 0, 0, 0]
    tissue, bone = extinction(transfer, 40, 1000)
    assert 0 < 2 * tissue < bone


def test_signs_are_alike() -> None:
    """Mirrored lobes are equally dense, and each has its own colours."""
    transfer = make_transfer_function(suggested(signed()).transfer, 1.0)
    value = 0.7 * float(signed().max())
    colors, depths = transfer.classify(np.array([-value, 0.0, value]))
    assert depths[1] == 0
    assert depths[0] == pytest.approx(depths[2], rel=0.02)
    assert colors[0][2] > colors[0][0] and colors[2][0] > colors[2][2]


def test_labels_that_stay_in_their_file_have_the_same_suggestion(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("renderer.readers.voxel_limits._MIN_MAPPED_BYTES", 1)
    for values in (labels(), (labels() > 1).astype(np.uint8)):
        np.save(tmp_path / "labels.npy", values)
        in_file = read_volume(VolumeSpec(FileSource(tmp_path / "labels.npy")))
        found = suggest(in_file, compute_statistics(in_file.values, in_file.source))
        assert in_file.source is not None and found == suggested(values)
        assert found.transfer.labels is not None
        assert found.transfer.labels.values == tuple(np.unique(values).tolist()[1:])
    assert suggested(two_materials("uint8")).transfer.labels is None


def test_labels_inside_of_each_other_are_all_glass_but_the_innermost() -> None:
    values = np.zeros((32, 32, 32), np.uint8)
    for label, margin in ((5, 2), (1, 6), (3, 10)):
        values[margin:-margin, margin:-margin, margin:-margin] = label
    outer, middle, inner = extinction(suggested(values).transfer, 5, 1, 3)
    assert 0 < 3 * max(outer, middle) < inner
    volume = volume_of(values)
    recoloured = suggest(volume, compute_statistics(volume.values), Wish("viridis"))
    np.testing.assert_allclose(extinction(recoloured.transfer, 5, 1, 3), (outer, middle, inner))


def test_the_smallest_number_is_a_mask() -> None:
    """Half of it is 0 in float64."""
    (inside,) = extinction(suggested(ball((0, 0, 0), 0.5) * 5e-324).transfer, 5e-324)
    assert inside > 0


def test_rays_meet_a_slice() -> None:
    z, y, x = np.meshgrid(0, *[np.linspace(-1, 1, 1000)] * 2, indexing="ij")
    shown = suggested(np.exp(-3 * (x**2 + y**2)) + 0 * z).visible
    assert sum(layer.share for layer in shown) == pytest.approx(1)


def test_smooth_volumes_of_few_levels_are_no_labels() -> None:
    """Most neighbours are equal in a slowly changing field, too, but unequal ones differ little."""
    z, y, x = np.meshgrid(*[np.linspace(-1, 1, 256)[:96]] * 3, indexing="ij")
    values = np.rint(60 * np.exp(-3 * (x**2 + y**2 + z**2))).astype(np.uint8)
    assert suggested(values).kind not in ("labels", "mask")


@pytest.mark.parametrize("num_values", [7, 40, 255])
def test_clipped_images_without_noise_are_no_labels(num_values: int) -> None:
    """Most voxels have the largest value, and the other values are those of an edge."""
    z, y, x = axes()
    edge = np.clip(24 * (0.9 - np.sqrt((x + 0.03) ** 2 + (y - 0.06) ** 2 + z**2)), 0, 1)
    values = np.rint(edge * (num_values - 1)).astype(np.uint8)
    assert suggested(values).kind not in ("labels", "mask")


def test_layers_side_by_side_are_labels() -> None:
    """Labels may ascend from the inside out, as the values of an edge do, if each layer is thick."""
    z, y, x = axes()
    radius = np.sqrt(x**2 + y**2 + z**2)
    values = np.where(radius < 0.9, 1 + radius * 6, 0).astype(np.uint8)
    assert suggested(values).kind == "labels"


def test_every_label_has_a_colour_of_its_own() -> None:
    values = np.zeros((40, 24, 24), np.uint8)
    values[4:36, 4:20, 4:20] = np.repeat([1, 2, 3, 4, 5, 6, 7, 8, 9, 10], [4, 4, 3, 3, 3, 3, 3, 3, 3, 3])[:, None, None]
    mapping = suggested(values).transfer.labels
    assert mapping is not None and min(style.opacity for style in mapping.styles) > 0
    colors = {style.color for style in mapping.styles}
    assert len(colors) == 10 and min(map(min, colors)) > 0.2 and max(map(max, colors)) < 0.95


@pytest.mark.parametrize("along", [(0, 1, 2), (2,)])
def test_single_voxels_are_not_called_pieces(along: tuple[int, ...]) -> None:
    """A chequerboard and stripes are masks without pieces."""
    suggestion = suggested(np.where(np.indices((32, 32, 32))[list(along)].sum(0) % 2, 200, 0).astype(np.uint8))
    assert (suggestion.kind, suggestion.reason) == ("mask", "there are 2 values, and 0 is the background")
    assert suggested(labels()).reason == "there are 5 values, in separate pieces, and 0 is the background"


@pytest.mark.parametrize(("extent", "offset"), [(10**6, 2**60), (10**10, -(2**60)), (10**15, 2**60)])
def test_points_are_told_apart_on_a_large_offset(extent: int, offset: int) -> None:
    """An offset that float64 resolves only to 256 changes no point by more than two thousandths of the range."""
    values = (np.asarray(KINDS["temperature"][0], np.float64) - 273) / 80
    values = np.rint(values / np.ptp(values) * extent).astype(np.int64)
    plain, shifted = (suggested(values + by).transfer.mapping for by in (0, offset))
    assert not isinstance(plain, ColormapSpec) and not isinstance(shifted, ColormapSpec)
    assert len(plain) == len(shifted) > 4
    for one, other in zip(plain, shifted, strict=True):
        assert other.value - offset == pytest.approx(one.value, abs=2e-3 * extent)
        assert one.opacity == pytest.approx(other.opacity, abs=5e-3)


def test_points_are_told_apart_beside_hot_voxels() -> None:
    """Points stay apart although they are much closer than a thousandth of the range."""
    values = two_materials("uint8") / 255
    hot = values.copy()
    hot[5, 6, 7:12] = np.arange(1, 6) * 6e3
    mapping = suggested(hot).transfer.mapping
    assert not isinstance(mapping, ColormapSpec)
    within = [point.value for point in mapping if 0.05 < point.value < 0.9]
    assert len(within) >= len(mapping) - 1 >= 3


def test_thousands_of_labels() -> None:
    z, y, x = np.meshgrid(*[np.arange(48) // 4] * 3, indexing="ij")
    numbers = np.random.Generator(np.random.PCG64(1)).permutation(12**3) * 3
    values = numbers[x + 12 * y + 144 * z].astype(np.uint16)
    values[:4] = values[-4:] = 0
    assert suggested(values).kind == "labels"


def test_light_comes_from_above_for_dark_objects_too() -> None:
    """Gradients point out of a dark object, so its light is turned."""
    bright, dark = (KINDS[name][0] for name in ("uint8", "dark object"))
    of_bright, of_dark = suggested(bright).shading, suggested(dark).shading
    assert of_bright is not None and of_dark is not None
    assert tuple(-part for part in of_bright.light) == of_dark.light


@pytest.mark.parametrize(
    "values",
    [
        np.zeros((1, 1, 1)), np.array([[[0.0, 1.0]]]), np.array([[[-1e308, 1e308]]]), np.arange(3.0).reshape(3, 1, 1),
        np.linspace(0, 1, 1000).reshape(10, 10, 10), np.array([0, 2**53 - 1], np.int64).reshape(1, 1, 2),
        np.full((1, 2, 3), 5e-324) * np.arange(3),
        np.where(np.arange(8**3) == 77, 255, 0).reshape(8, 8, 8).astype(np.uint8),
        np.where(np.arange(60**3) == 77, 1e30, 0.5).reshape(60, 60, 60),
    ],
    ids=["voxel", "two", "far apart", "three", "ramp", "large", "denormal", "one bright", "one bright of many"],
)  # fmt: skip
def test_odd_volumes_get_something_that_is_visible(values: Array) -> None:
    suggestion = suggested(values)
    between = [at.value for at in suggestion.transfer.points if values.min() <= at.value <= values.max()]
    assert max(extinction(suggestion.transfer, *np.unique(values).tolist(), *between)) > 0
    assert suggestion.transfer.unit is not None and suggestion.transfer.unit > 0


def closed_head(fat: int = 210, skull: int = 60, brain: int = 130) -> Array:
    """uint8: dark skull and bright fat around a brain."""
    n = 96
    values = np.zeros((n, n, n))
    for radius, value in ((0.92, fat), (0.80, skull), (0.68, brain)):
        values[ball((0, 0, 0), radius, n)] = value
    return (blurred(values) + 2 * noise(8, n)).clip(0, 255).astype(np.uint8)


@pytest.mark.parametrize("skull", [60, 130], ids=["three materials", "two materials"])
def test_a_corner_is_clipped_of_an_object_that_hides_its_inside(skull: int) -> None:
    found = suggested(closed_head(skull=skull))
    assert found.clip[-1].box is not None and "a corner is clipped" in found.reason
    brain, skull = extinction(found.transfer, 130, skull)
    assert brain > 0 and skull > 0  # clipped faces are closed
    assert len({point.color for point in found.transfer.mapping}) == 4  # and show what is inside
    inverted = suggested(np.where(closed_head() > 170, 60, closed_head()).astype(np.uint8))
    assert not inverted.clip


def test_small_labels_are_labels_and_enlarged_scans_are_not() -> None:
    """Boxes of three voxels, each with its own label, and a scan in which every voxel is repeated three times."""
    z, y, x = np.meshgrid(*[np.arange(48) // 3] * 3, indexing="ij")
    numbers = np.where(ball((0, 0, 0), 0.8, 48), 1 + x + 16 * y + 256 * z, 0).astype(np.uint16)
    assert suggested(numbers).kind == "labels"
    scan = (40 * KINDS["uint16"][0][::3, ::3, ::3].astype(np.float64) / 65535).astype(np.uint16)
    assert suggested(scan.repeat(3, 0).repeat(3, 1).repeat(3, 2)).kind == "scan without an absolute scale"


@pytest.mark.parametrize("name", ["uint8", "dark object"])
def test_a_scan_with_a_unit_has_an_absolute_scale(name: str) -> None:
    values, kind = KINDS[name]
    volume = replace(volume_of(values), value_unit="HU")
    found = suggest(volume, compute_statistics(volume.values), Wish())
    assert found.kind == kind.replace("without an absolute scale", "in HU") != kind


def test_an_object_that_fills_most_of_the_border_of_a_slab_is_shown() -> None:
    """Between air on four narrow faces, with noise; and as a column of which two blocks reach five faces."""
    z, y, x = axes(64)
    slab = np.where(np.hypot(x, y) < 0.95, 100.0, 0.0)[:12] + 3 * noise(5, 64)[:12]
    (object_depth, air_depth) = extinction(suggested(slab.clip(0).astype(np.uint8)).transfer, 100, 0)
    assert object_depth > 0 and air_depth == 0
    blocks = np.where((np.abs(z) > 0.5) | (np.hypot(x, y) < 0.3), 100.0 + 5 * noise(6, 64), 0.0)
    inside, gap = extinction(suggested(blocks.astype(np.float32)).transfer, 100, 0)
    assert inside > 0 and gap == 0


def test_weak_lobes_of_a_field_with_two_signs_are_shown() -> None:
    """Where a few values are many times those of the others."""
    z, y, x = axes(64)

    def lobe(at: float, height: float) -> Array:
        return height * np.exp(-((x - at) ** 2 + y**2 + z**2) * 30) * z

    found = suggested((lobe(-0.5, 1.0) + lobe(0.5, 0.2)).astype(np.float32))
    assert found.kind == "field with two signs"
    weakest = min(abs(point.value) for point in found.transfer.mapping if point.opacity > 0)
    assert weakest < 0.9 * np.abs(lobe(0.5, 0.2)).max()


def test_a_scan_without_background_shows_its_brighter_material() -> None:
    """Balls on a ground as bright as half of them, both noisy, up to the border: no shells, which noise would tear."""
    cells = np.zeros((N, N, N))
    for centre in np.random.Generator(np.random.PCG64(2)).uniform(-1, 1, (40, 3)):
        cells[ball(tuple(centre), 0.25)] = 1.0
    found = suggested((100 + 100 * cells + 35 * noise(7)).clip(0).astype(np.uint16))
    inside, ground = extinction(found.transfer, 200, 100)
    assert found.kind == "filled scan" and not found.clip
    assert inside > 10 * max(ground, 1e-6)


def test_a_density_that_continues_beyond_the_border_is_shown() -> None:
    """Atoms of a crystal in a smooth density that is like noise at the border, too: no background."""
    random = np.random.Generator(np.random.PCG64(5))
    waves = np.fft.fftn(random.normal(size=(64, 64, 64)))
    k = np.linalg.norm(np.stack(np.meshgrid(*[np.fft.fftfreq(64)] * 3)), axis=0)
    smooth = np.real(np.fft.ifftn(np.where(k < 0.15, waves, 0)))
    smooth /= smooth.std()
    atoms = (smooth + 0.4 * np.maximum(smooth, 0) ** 3).astype(np.float32)
    found = suggested(atoms)
    first = min(point.value for point in found.transfer.mapping if point.opacity > 0)
    assert 0.01 < np.mean(atoms > first) < 0.3, found.kind


@pytest.mark.parametrize("scale", [1e-24, 1.0, 1e12])
@pytest.mark.parametrize("form", ["halo", "filled", "in a vacuum"])
def test_densities_over_many_orders_of_magnitude_have_a_logarithmic_scale(form: str, scale: float) -> None:
    z, y, x = axes()
    waves = np.sin(5 * x + 1) * np.cos(4 * y) + np.sin(6 * z + x) + np.cos(5 * y - 3 * z)
    radius = np.sqrt(x**2 + y**2 + (2 * z) ** 2) + 0.01
    values = scale * (np.exp(3 * waves) if form == "filled" else radius**-5 * np.exp(0.5 * waves))
    if form == "in a vacuum":
        values[radius > 1] = 0
    found = suggested(values)
    assert found.kind == "density over many orders of magnitude"
    mapping = found.transfer.mapping
    assert isinstance(mapping, ColormapSpec) and mapping.scale == "log" and mapping.range[0] > 0
    # The levels are far apart, and all is not fog.
    peaks = [value for value, opacity in mapping.opacity if opacity]
    assert len(peaks) >= 2 and min(b / a for a, b in pairwise(peaks)) > 2
    visible = np.array(extinction(found.transfer, *values.ravel().tolist())) > 0
    assert 0.002 < visible.mean() < 0.4
    logs = suggested(np.log10(np.maximum(values, values[values > 0].min())))
    if form == "halo":  # the levels are those of the logarithms
        own = [point.value for point in logs.transfer.mapping if point.opacity]
        np.testing.assert_allclose(np.log10(peaks), own, atol=0.15)


def test_noise_and_a_point_have_no_logarithmic_scale() -> None:
    values = np.abs(100 + 10 * noise(3)).astype(np.float32)
    values[20:23, 20:23, 20:23] = 1e6
    assert not isinstance(suggested(values).transfer.mapping, ColormapSpec)


@pytest.mark.parametrize("outside", ["zeros", "noise", "no data"])
def test_noise_of_a_map_of_statistics_is_not_drawn(outside: str) -> None:
    """Noise of standard deviation 1 has 99.7 % of its values within 3; an activation and its opposite reach 9."""
    z, y, x = axes()
    random = np.random.default_rng(0)
    values = random.normal(size=x.shape)
    for sign, place in ((1, 0.4), (-1, -0.4)):
        values += sign * 9 * np.exp(-((x - place) ** 2 + y**2 + z**2) / 0.02)
    if outside != "noise":
        values[x**2 + y**2 + z**2 > 0.8] = 0 if outside == "zeros" else np.nan
    volume = volume_of(values.astype(np.float32))
    found = suggest(volume, compute_statistics(volume.values))
    assert found.kind == "field with two signs" and "noise" in found.reason
    shown = [low for layer in found.visible for low, _ in layer.ranges] + [
        high for layer in found.visible for _, high in layer.ranges
    ]
    assert 3 < min(map(abs, shown)) < 6 and min(shown) < 0 < max(shown)


def test_a_field_of_two_signs_without_noise_is_shown_from_near_its_middle() -> None:
    found = suggested(signed())
    assert "noise" not in found.reason
    assert min(abs(end) for layer in found.visible for pair in layer.ranges for end in pair) < 0.2 * signed().max()
