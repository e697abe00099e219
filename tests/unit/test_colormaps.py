"""The names of colormaps are those that cmap knows, and the colours are cmap's."""

from __future__ import annotations

import cmap
import pytest

from renderer.scene import colormap_points, is_colormap, nearest_colormap

# The colormaps that ParaView offers by other names than the package, as ParaView writes them.
PARAVIEW_NAMES = [
    "Cool to Warm", "Warm to Cool", "Grayscale", "X Ray", "2hot", "Red Temperature", "Viridis (matplotlib)",
    "Inferno (matplotlib)", "Plasma (matplotlib)", "Magma (matplotlib)", "copper_Matlab", "pink_Matlab", "bone_Matlab",
    "gray_and_red", "GyRd", "Spectral_lowBlue", "GnRP", "GYPi", "GnYlRd", "GBBr", "OrPu", "GnBuPu", "BuGnYl", "RdOr",
    "BrOrYl", "RdOrYl",
]  # fmt: skip


def test_the_names_of_the_package_are_known() -> None:
    names = sorted(cmap.Colormap.catalog())
    assert len(names) > 100
    assert all(is_colormap(name) for name in names[::40])


@pytest.mark.parametrize("name", ["viridis", "Viridis_r", "matplotlib:bwr", "crameri:batlow_r", "YlGn", "gray"])
def test_a_name_in_any_spelling_is_known(name: str) -> None:
    assert is_colormap(name)
    assert len(colormap_points(name, 5)) == 5


@pytest.mark.parametrize("name", ["", "_r", "virides", "nowhere:viridis", "viridis:", "#ff0000", "\0"])
def test_other_names_are_unknown(name: str) -> None:
    assert not is_colormap(name)


@pytest.mark.parametrize(
    ("name", "meant"),
    [("virides", "viridis"), ("viridus_r", "viridis_r"), ("colorcet:fir", "colorcet:fire"), ("qq", None)],
)
def test_a_misspelt_name_has_a_nearest_one(name: str, meant: str | None) -> None:
    assert nearest_colormap(name) == meant


def test_points_run_from_end_to_end() -> None:
    # matplotlib's published table of viridis begins and ends with these.
    points = colormap_points("viridis", 256)
    assert points[0] == pytest.approx((0.267004, 0.004874, 0.329415), abs=1e-6)
    assert points[-1] == pytest.approx((0.993248, 0.906157, 0.143936), abs=1e-6)
    for reverse, point in zip(colormap_points("viridis_r", 256), points[::-1], strict=True):
        assert reverse == pytest.approx(point, abs=1e-12)


def test_points_between_the_stops_are_interpolated() -> None:
    assert colormap_points("gray", 5) == [pytest.approx((i / 4,) * 3, abs=1e-6) for i in range(5)]


@pytest.mark.parametrize("name", PARAVIEW_NAMES)
def test_names_of_paraview_are_known(name: str) -> None:
    """Also reversed; none hides a name of the package."""
    assert not any(name.lower() == known.lower() for known in cmap.Colormap.catalog())
    assert is_colormap(name)
    assert colormap_points(f"{name}_r", 9) == [pytest.approx(point) for point in colormap_points(name, 9)[::-1]]


@pytest.mark.parametrize(
    ("name", "first", "middle", "last"),
    [
        ("Cool to Warm", (0.231, 0.298, 0.753), (0.865, 0.865, 0.865), (0.706, 0.016, 0.149)),
        ("Warm to Cool", (0.706, 0.016, 0.149), (0.865, 0.865, 0.865), (0.231, 0.298, 0.753)),
        ("X Ray", (1, 1, 1), (0.5, 0.5, 0.5), (0, 0, 0)),
        ("Grayscale", (0, 0, 0), (0.5, 0.5, 0.5), (1, 1, 1)),
        ("GnYlRd", (0, 0.408, 0.216), (1.0, 1.0, 0.749), (0.647, 0, 0.149)),
    ],
)
def test_colours_are_those_of_paraview(name: str, first: object, middle: object, last: object) -> None:
    points = colormap_points(name, 257)
    assert points[0] == pytest.approx(first, abs=0.01)
    assert points[128] == pytest.approx(middle, abs=0.02)
    assert points[-1] == pytest.approx(last, abs=0.01)


def test_a_misspelt_name_of_paraview_has_a_nearest_one() -> None:
    assert nearest_colormap("Cool to Warn") == "cool_to_warm"
