"""Surfaces of matter that scatters light, against closed forms and against paths; errors in standard errors."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from brickwork import transfer_of
from ray_integrals import volume
from stage_pictures import drawn
from test_paths import EVEN as EVEN_SKY, FOUR, down, sources
from test_scattered_light import (
    CLEAR,
    EVEN,
    SOLID,
    TURNED,
    blobs,
    colors_of,
    film_of,
    points,
    scene_of,
    stage_of,
    volume as field,
)

from renderer.errors import SceneError
from renderer.frame import view_of
from renderer.layers import frames_of_new_light
from renderer.lighting import BRIGHT_SHARE, sources_of
from renderer.scene import ClipSpec, PlaneSpec, SurfaceSpec, Vector, parse_scene
from renderer.transfer import albedo_of_thick, surface_reflectance
from renderer.truth import PathTracer, TrueLayer, light_of_pixels, states_of
from renderer.view import View
from renderer.volume import Array, Float32, Float64

BLACK = {"top": "black", "horizon": "black", "bottom": "black"}
SHINY = SurfaceSpec(1.0, 0.5, 20.0)
DULL = SurfaceSpec(1.0, 0.0, 20.0)


def ball(side: int = 28, radius: float = 10.0) -> Float32:
    """A ball with a border of one voxel."""
    z, y, x = np.indices((side,) * 3) - (side - 1) / 2
    return np.clip(radius + 0.5 - np.sqrt(x**2 + y**2 + z**2), 0, 1).astype(np.float32)


def wall(albedo: float, tilt: float = 0.0) -> TrueLayer:
    """Matter below a plane through the origin that is turned by `tilt` degrees about y: a ramp of opacity below it.

    The scalar is the depth. From clear to opaque is a hundredth of a voxel: all points that are seen are surfaces.
    """
    a = np.radians(tilt)
    turned = np.eye(4)
    turned[:3, :3] = [[np.cos(a), 0, np.sin(a)], [0, 1, 0], [-np.sin(a), 0, np.cos(a)]]
    wide = turned @ np.diag([1e3, 1e3, 1.0, 1.0])
    values = np.broadcast_to(-np.arange(-4.0, 2.0)[:, None, None], (6, 3, 3))
    wide[:3, 3] = -wide[:3, :3] @ [1.0, 1.0, 4.0]
    color = (albedo, albedo, albedo)
    return TrueLayer(volume(values, wide), transfer_of((0.0, color, 0.0), (0.01, color, 20.0), (4.0, color, 20.0)))


def traced(layer: TrueLayer, light: Any, num: int, view: View | None = None) -> tuple[Float64, Float64]:
    """The mean light of rays at the origin, and its standard error."""
    seen = replace(down(layer), target=(0.0, 0.0, 0.0)) if view is None else view
    places, states = np.tile(np.array(seen.size) / 2, (num, 1)), states_of(np.zeros(num, np.int64), (3,))
    found = PathTracer([layer], light).trace(seen, places, states, 1)
    return found.mean(axis=0), found.std(axis=0) / np.sqrt(num)


def test_white_surfaces_are_not_seen_in_even_light() -> None:
    """A furnace: every path brings 1 back, also from a surface."""
    found, error = traced(wall(1.0, 30.0), sources(EVEN_SKY)._replace(surface=DULL), 100)
    assert found[3] == pytest.approx(1)
    np.testing.assert_allclose(found[:3], 1, rtol=1e-12)
    assert error[0] < 1e-12


@pytest.mark.parametrize(("tilt", "radius"), [(0.0, 0.01), (50.0, 0.01), (30.0, 20.0)])
def test_a_surface_under_a_key_light_follows_lamberts_law(tilt: float, radius: float) -> None:
    """In front of dark matter, which absorbs along the way to the light m' and to the eye m: m / (m + m') cosine."""
    albedo, cosine = 1e-5, np.cos(np.radians(tilt))
    light = sources(key=(0.0, 0.0, 1.0), radius=radius, irradiance=3.0)._replace(surface=DULL)
    found, error = traced(wall(albedo, tilt), light, 8000)
    # Light and eye are on the same side and, for small radii, have the same way through the matter.
    mean_cosine = 1.0 if radius < 1 else np.cos(np.radians(radius) / 2) ** 2
    expected = surface_reflectance(albedo) * 3.0 / np.pi * cosine / 2 * mean_cosine
    assert error[0] < 0.02 * expected
    assert found[0] == pytest.approx(expected, abs=FOUR * error[0] + 0.004 * expected)


def test_highlights_are_where_a_surface_mirrors_the_key_light() -> None:
    """Matter that absorbs all light shows highlights alone: specular (n . h)^shininess times irradiance / (2 pi)."""
    for tilt, away in ((0.0, 0.0), (20.0, 40.0), (0.0, 40.0)):
        key: Vector = (float(np.sin(np.radians(away))), 0.0, float(np.cos(np.radians(away))))
        light = sources(key=key, irradiance=2.0)._replace(surface=SHINY)
        found, error = traced(wall(0.0, tilt), light, 8000)
        to_eye, to_key = np.cos(np.radians(tilt)), np.cos(np.radians(away - tilt))
        highlight = 0.5 * np.cos(np.radians(away / 2 - tilt)) ** 20 * 2 / np.pi
        assert found[0] == pytest.approx(highlight / (1 + to_eye / to_key), abs=FOUR * error[0] + 1e-4)


def test_opaque_matter_keeps_its_colour_in_even_light_with_surfaces() -> None:
    """Half-spaces of surfaces are as bright as half-spaces that scatter."""
    for color in (0.05, 0.4, 0.9):
        albedo = float(albedo_of_thick(color))
        found, error = traced(wall(albedo), sources(EVEN_SKY)._replace(surface=DULL), 8000)
        assert found[0] == pytest.approx(color, rel=0.035, abs=FOUR * error[0])


def test_even_matter_has_no_surface_but_where_it_is_cut() -> None:
    """Dark even matter under a key light, cut by a plane at an angle: Lambert's law on the cut face alone."""
    dark = transfer_of((0.0, (1e-5,) * 3, 20.0), (2.0, (1e-5,) * 3, 20.0))
    even, tilt = TrueLayer(volume(np.ones((9, 9, 9)), np.diag([9.0, 9.0, 9.0, 1.0])), dark), np.radians(40.0)
    plane = PlaneSpec(tuple(even.volume.centre.tolist()), (float(np.sin(tilt)), 0.0, float(np.cos(tilt))))
    cut = even._replace(clip=(ClipSpec(plane=plane),))
    light = sources(key=(0.0, 0.0, 1.0), irradiance=3.0)._replace(surface=DULL)
    found, error = traced(cut, light, 8000, down(even))
    on_face = surface_reflectance(1e-5) * 3.0 / np.pi * np.cos(tilt) / 2
    assert found[0] == pytest.approx(on_face, abs=FOUR * error[0] + 0.02 * on_face)
    inside, _ = traced(even, light, 10000, down(even))
    assert inside[0] == pytest.approx(1e-5 * 3.0 / np.pi / 8, rel=0.03)  # scattered, to all directions alike


def test_labels_have_surfaces() -> None:
    """A block of a dark label: its top follows Lambert's law, for a border that is flat."""
    values = np.zeros((9, 21, 21), np.uint8)
    values[:5] = 1
    labels = replace(volume(values), values=values, is_labels=True)
    layer = TrueLayer(labels, transfer_of((0.5, (1e-5,) * 3, 0.0), (0.5, (1e-5,) * 3, 20.0), (2.0, (1e-5,) * 3, 20.0)))
    light = sources(key=(0.6, 0.0, 0.8), irradiance=3.0)._replace(surface=DULL)
    found, error = traced(layer, light, 8000, down(layer))
    expected = surface_reflectance(1e-5) * 3.0 / np.pi * 0.8 / (1 + 1 / 0.8)
    assert found[0] == pytest.approx(expected, abs=FOUR * error[0] + 0.02 * expected)


def pictures(light: dict[str, Any], look: dict[str, Any], values: Array) -> tuple[Float64, Float64]:
    """Return the linear light of a drawn picture, [n, 3], and two independent halves of its paths, [2, n, 3]."""
    size = 24
    output = {"file": "film.mp4", "size": [size, size]}
    stage = stage_of(scene_of(look, light=light | {"exposure": 0}, output=output), field(values))
    assert stage.scene.light is not None
    layers = [TrueLayer(each.volume, each.optics, weight=each.spec.weight) for each in stage.layers]
    tracer, pixels = PathTracer(layers, sources_of(stage.scene.light)), np.arange(size**2)
    truth = light_of_pixels(tracer, view_of(stage, 0), pixels, seed=(1,), standard_error=0.0, most_paths=128)
    return drawn(stage, number=0).reshape(-1, 4)[:, :3].astype(np.float64), truth.halves[..., :3]


@pytest.mark.parametrize("surface", [0.0, 0.7])
def test_white_matter_with_surfaces_is_as_bright_as_an_even_sky(surface: float) -> None:
    for opacities in (SOLID, CLEAR):
        light = EVEN | {"surface": surface, "specular": 1}
        stage = stage_of(scene_of({"transfer_function": points("white", opacities)}, light=light), field(blobs()))
        colors = colors_of(drawn(stage))
        assert len(colors) > 300
        np.testing.assert_allclose(colors, 1, atol=0.01)


@pytest.mark.parametrize("falls", [False, True], ids=["rises", "falls"])
def test_a_drawn_ball_agrees_with_paths(falls: bool) -> None:
    """A ball whose opacity rises or falls with the scalar; errors are measured without the noise of paths."""
    solid = [{"value": 0.0, "opacity": 1.0}, {"value": 1.0, "opacity": 0.0}] if falls else SOLID
    light = {
        "environment": "outdoor",
        "key": {"direction": [0.3, -1, 0.8], "strength": 2},
        "surface": 1,
        "specular": 0.3,
    }
    values = ball()
    found, (one, two) = pictures(
        light, {"transfer_function": points("#c08040", solid)}, 1 - values if falls else values
    )
    error = ((found - one) * (found - two)).mean() / (one * two).mean()
    assert found.mean() == pytest.approx((one.mean() + two.mean()) / 2, rel=0.12)
    assert error < 0.175**2


def test_the_exposure_is_chosen_by_the_light_of_surfaces() -> None:
    """Nine tenths of a dark ball with broad highlights are not far brighter than in even light: 33 times by albedo."""
    key = {"direction": [1, -1, 1], "strength": 4}
    light = {"environment": "studio", "key": key, "surface": 1, "specular": 1, "shininess": 3}
    look = {"transfer_function": points("#303030")}
    stages = [stage_of(scene_of(look, light=each), field(ball())) for each in (light, EVEN)]
    shown, even = (np.concatenate([drawn(stage, number=side) for side in (0, 2, 4, 6)]) for stage in stages)
    solid = even[..., 3] > 0.99
    ratios = shown[solid][:, :3].sum(axis=1) / even[solid][:, :3].sum(axis=1)
    assert 0.8 < np.quantile(ratios, BRIGHT_SHARE) < 2.5


def test_highlights_of_a_drawn_ball_are_at_the_mirror_angle() -> None:
    """A black ball shows one spot, halfway between the directions to the key light and to the viewer."""
    light = {
        "environment": BLACK,
        "key": {"direction": [1, -1, 0]},
        "surface": 1,
        "specular": 1,
        "shininess": 60,
        "exposure": 0,
    }
    camera = {"path": {"type": "turntable", "frames": 8}, "projection": "orthographic"}
    scene = scene_of({"transfer_function": points("black")}, light=light, camera=camera)
    stage = stage_of(scene, field(ball()))
    view = view_of(stage, 0)
    light_on = drawn(stage, number=0)[..., 0]
    assert light_on.max() > 0.1
    row, column = np.unravel_index(light_on.argmax(), light_on.shape)
    to_eye = view.axes[2]
    halfway = np.array([1, -1, 0]) / np.sqrt(2) + to_eye
    spot = view.axes @ (halfway / np.linalg.norm(halfway)) * 10 * view.scale_px
    assert abs(column + 0.5 - 24 - spot[0]) < 2
    assert abs(row + 0.5 - 24 + spot[1]) < 2


def test_the_look_up_of_flux_is_turned_as_the_volume_is() -> None:
    """A ball on a grid that is turned in the world shows the same light as on a grid that is not.

    Cells have the axes of the world: a face across an axis is a little darker than others.
    """
    light = {"environment": BLACK, "key": {"direction": [0.5, -1, 0.6]}, "surface": 1, "exposure": 0}
    found = []
    for affine in (np.eye(4), TURNED):
        straight = affine.copy()
        straight[:3, :3] /= np.linalg.norm(affine[:3, :3], axis=0)
        straight[:3, 3] = -straight[:3, :3] @ np.full(3, 13.5)
        stage = stage_of(scene_of({"transfer_function": points("gray")}, light=light), field(ball(), straight))
        found.append(drawn(stage, number=0)[..., :3])
    assert found[0].mean() > 0.02
    np.testing.assert_allclose(found[0].mean(), found[1].mean(), rtol=0.09)
    assert np.abs(found[0] - found[1]).mean() < 0.16 * found[0].mean()


def test_surfaces_do_not_depend_on_threads() -> None:
    light = {"key": {}, "surface": 0.8, "specular": 0.2}
    scene = scene_of({"transfer_function": points("#c08040", CLEAR)}, light=light)
    both = [drawn(stage_of(scene, field(blobs()), num_threads=num), num_threads=num) for num in (1, 3)]
    np.testing.assert_array_equal(*both)


@pytest.mark.parametrize("error", [{"splats": 200}, {"finest_level": 1}])
def test_larger_cells_have_no_surfaces(error: dict[str, Any]) -> None:
    scene = scene_of({"transfer_function": points("white")}, light=EVEN | {"surface": 0.5}, error=error)
    with pytest.raises(SceneError, match=r"light\.surface: contradicts error\."):
        parse_scene(scene, base=Path())


def test_a_key_light_that_follows_the_camera_is_found_on_each_frame_of_a_turn() -> None:
    light = {"environment": BLACK, "key": {"direction": "camera"}, "surface": 1}
    film = film_of(scene_of({"transfer_function": points("gray")}, light=light), field(ball()))
    found = []
    for frame in (0, 3):
        stage, view = film.at(frame), view_of(film, frame)
        assert stage.scene.light is not None and stage.scene.light.key is not None
        np.testing.assert_allclose(stage.scene.light.key.direction, view.axes[2], atol=1e-12)
        found.append(drawn(stage, number=frame)[..., 0])
    lights = [film.at(frame).groups[0].light for frame in (0, 3, 3)]
    assert lights[0] is not None and lights[1] is not None
    assert lights[1] is lights[2]
    assert lights[0].stops == lights[1].stops
    # A ball has the same light on all frames, brightest in the middle, as the light comes from the viewer.
    np.testing.assert_allclose(found[0].mean(), found[1].mean(), rtol=0.12)
    for picture in found:
        assert picture[20:28, 20:28].mean() > 1.2 * picture[picture > 0.01].mean()


def test_the_frames_of_new_light_are_told() -> None:
    def runs(light: dict[str, Any], **camera: Any) -> list[tuple[int, int]]:
        path = {"type": "turntable", "frames": 8}
        return frames_of_new_light(
            parse_scene(
                scene_of({"transfer_function": points("gray")}, light=light, camera={"path": camera.get("path", path)}),
                base=Path(),
            )
        )

    following: dict[str, Any] = {"key": {"direction": "camera"}}
    assert runs(following) == [(1, 7)]
    assert runs(following, path={"type": "hold", "frames": 5}) == []
    assert runs({"key": {"direction": {2: [0, 0, 1], 4: [1, 0, 0]}}}) == [(3, 4)]
    assert runs({"key": {}}) == []
