"""The names of colormaps are those that cmap knows, and the colours are cmap's."""

from __future__ import annotations

import cmap
import pytest

from renderer.scene import colormap_points
from renderer.scene.colormaps import is_colormap, nearest_colormap


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
