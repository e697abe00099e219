"""Pictures of matter that scatters light, against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from stage_pictures import NUMBER, drawn

from renderer.annotation import Patch, draw_annotation
from renderer.cache import caching_in
from renderer.draw import draw_lines, make_outline
from renderer.errors import SceneError
from renderer.film import quantize
from renderer.frame import FilmStage, Stage, prepare_stage, view_of
from renderer.kernels import kernels
from renderer.lighting import Matter, choose_stops, compute_radiance_grid, sources_of
from renderer.scene import KeySpec, LightSpec, parse_scene
from renderer.transfer import linear_of_srgb
from renderer.truth import PathTracer, TrueLayer, light_of_pixels
from renderer.volume import Float32, Float64, Volume, make_volume

WHITE_SKY = {"top": "white", "horizon": "white", "bottom": "white"}
EVEN = {"environment": WHITE_SKY, "exposure": 0}
ORANGE = (1.0, 0.5, 0.25)
# Colours of opaque matter, by the scalar: nothing at 0, opacity 1 from 1 on.
SOLID = [{"value": 0.0, "opacity": 0.0}, {"value": 1.0, "opacity": 1.0}]


def points(color: Any, opacities: list[dict[str, float]] = SOLID) -> dict[str, Any]:
    return {"points": [{**each, "color": color} for each in opacities]}


def scene_of(*layers: dict[str, Any], light: Any = EVEN, **sections: Any) -> dict[str, Any]:
    volumes = [{"procedural": {"name": "constant", "shape": [9, 9, 9]}} | layer for layer in layers]
    scene: dict[str, Any] = {"volumes": volumes, "camera": {"path": {"type": "turntable", "frames": 8}}}
    scene |= {"output": {"file": "film.mp4", "size": [48, 48]}, "error": {"tolerance": 0.05}}
    return scene | ({} if light is None else {"light": light}) | sections


def film_of(scene: dict[str, Any], *volumes: Volume, num_threads: int = 2) -> FilmStage:
    film = parse_scene(scene, base=Path())
    return prepare_stage(film, clock=lambda: 0.0, num_threads=num_threads, volumes=volumes)


def stage_of(scene: dict[str, Any], *volumes: Volume, num_threads: int = 2) -> Stage:
    film = film_of(scene, *volumes, num_threads=num_threads)
    assert isinstance(film, Stage)
    return film


def volume(values: npt.NDArray[np.float32], affine: Float64 | None = None, name: str = "matter") -> Volume:
    return make_volume(np.ascontiguousarray(values, np.float32), np.eye(4) if affine is None else affine, name)


def blobs(seed: int = 1, side: int = 24) -> npt.NDArray[np.float32]:
    """Return smooth blobs of scalars from 0 to 1 around the middle of a volume."""
    random = np.random.default_rng(seed).random((side,) * 3)
    for axis in range(3):
        random = sum(np.roll(random, shift, axis) for shift in range(-2, 3)) / 5
    z, y, x = np.indices(random.shape) - (side - 1) / 2
    inside = x**2 + y**2 + z**2 < (0.45 * side) ** 2
    return np.clip((random - 0.45) * 10, 0, 1).astype(np.float32) * inside


def cube(side: int = 24, width: int = 14) -> npt.NDArray[np.float32]:
    values, low = np.zeros((side,) * 3, np.float32), (side - width) // 2
    values[low:-low, low:-low, low:-low] = 1
    return values


def colors_of(radiance: Float32, least: float = 0.02) -> Float32:
    """Return the colours of pixels of at least some opacity, without the factor of their opacity."""
    seen = radiance[radiance[..., 3] > least]
    return seen[:, :3] / seen[:, 3:]


TURNED = np.array([[0.8, -0.6, 0, 3], [0.6, 0.8, 0, -9], [0, 0, 1.1, 1], [0, 0, 0, 1.0]])
CLEAR = [{"value": 0.0, "opacity": 0.0}, {"value": 1.0, "opacity": 0.3}]


@pytest.mark.parametrize("kind", ["one", "grids", "means", "opaque"])
def test_white_matter_under_an_even_sky_is_as_bright(kind: str) -> None:
    """A furnace: matter that absorbs nothing is not seen before the sky, wherever it is and however it is drawn."""
    layer = {"transfer_function": points("white", SOLID if kind == "opaque" else CLEAR)}
    volumes = [volume(blobs())] + ([volume(blobs(2), TURNED)] if kind == "grids" else [])
    scene = scene_of(
        *[layer for _ in volumes], error={"tolerance": 0.05} | ({"finest_level": 1} if kind == "means" else {})
    )
    scene["light"] = EVEN | {"exposure": -1}
    radiance = drawn(stage_of(scene, *volumes))
    colors = colors_of(radiance)
    assert len(colors) > 300
    np.testing.assert_allclose(colors, 0.5, atol=0.002)
    half = 188 / 255  # linear 0.5
    levels = quantize(radiance, (half, half, half), is_linear=True)
    assert levels.min() >= 187
    assert levels.max() <= 189


def test_matter_that_absorbs_all_light_shows_none() -> None:
    """Its opacity is that of the same matter without a light, and a background behind it dims in linear light."""
    layer = {"transfer_function": points("black", CLEAR)}
    dark, unlit = (drawn(stage_of(scene_of(layer, light=light), volume(blobs()))) for light in (EVEN, None))
    assert not dark[..., :3].any()
    np.testing.assert_allclose(dark[..., 3], unlit[..., 3], atol=2e-6)
    over = quantize(dark, (1.0, 1.0, 1.0), is_linear=True)[..., 0]
    np.testing.assert_allclose(linear_of_srgb(over / 255), 1 - dark[..., 3], atol=0.005)


def test_opaque_orange_stays_orange_in_even_light() -> None:
    """It is as near to paths of light as to its colour, which albedos of a ramp to opacity 1 do not give exactly."""
    stage = stage_of(scene_of({"transfer_function": points(list(ORANGE))}), volume(cube()))
    shown = np.median(drawn(stage, number=0)[16:32, 16:32, :3], axis=(0, 1))
    assert stage.scene.light is not None
    tracer = PathTracer([TrueLayer(each.volume, each.optics) for each in stage.layers], sources_of(stage.scene.light))
    pixels = np.arange(16, 32, 4)[:, None] * 48 + np.arange(16, 32, 4)
    paths = light_of_pixels(tracer, view_of(stage, 0), pixels.ravel(), seed=(1,), standard_error=0.0, most_paths=800)
    colors = np.array([[[*shown, 1.0], [*paths.colors[:, :3].mean(axis=0), 1.0]]], np.float32)
    grid, truth = quantize(np.minimum(colors, 1), (0.0, 0.0, 0.0), 16, is_linear=True)[0] / 65535
    np.testing.assert_allclose(grid, truth, atol=0.05)
    np.testing.assert_allclose(truth, ORANGE, atol=0.07)


def test_a_layer_shadows_another_and_colours_it() -> None:
    """A red plate above a white block, lit from above: the block is darker, and redder near the plate."""
    key = {"direction": [0, 0, 1], "strength": 1}
    light = {"environment": {"top": "#202020", "horizon": "#202020", "bottom": "#202020"}, "key": key, "exposure": 0}
    block, plate = np.zeros((2, 24, 24, 24), np.float32)
    block[4:9, 4:20, 4:20], plate[16:18, 8:16, 8:16] = 1, 1
    camera = {"path": {"type": "turntable", "frames": 8, "elevation": 30}}
    look, red = {"transfer_function": points("white")}, {"transfer_function": points("red"), "weight": 0.0}

    def picture(weight: float) -> Float32:
        scene = scene_of(look, red | {"weight": weight}, light=light, camera=camera)
        return drawn(stage_of(scene, volume(block), volume(plate)), number=0)

    alone, shadowed = picture(0.0), picture(1.0)
    front = (slice(34, 44), slice(20, 28))
    assert alone[front][..., :3].mean() > 0.05
    below = shadowed[28:34, 16:32, :3].mean(axis=(0, 1)) / alone[28:34, 16:32, :3].mean(axis=(0, 1))
    assert below.max() < 0.8


def test_pictures_are_the_same_for_any_number_of_threads() -> None:
    scene = scene_of({"transfer_function": points(list(ORANGE), CLEAR)}, light={"key": {}})
    pictures = [drawn(stage_of(scene, volume(blobs()), num_threads=num), num_threads=num) for num in (1, 3)]
    np.testing.assert_array_equal(*pictures)


def test_light_is_found_once_while_only_the_camera_moves() -> None:
    camera = {"path": {"type": "turntable", "frames": 8}, "field_of_view": {0: 20, 7: 40}}
    film = film_of(scene_of({"transfer_function": points("white")}, camera=camera), volume(cube()))
    lights = [film.at(frame).groups[0].light for frame in (0, 3, 7)]
    assert film.scene.moves and lights[0] is not None
    assert lights[0] is lights[1] is lights[2] is film.groups[0].light


def test_light_that_moves_is_found_again_with_the_exposure_of_the_first_frame() -> None:
    light = {"environment": "overcast", "key": {"direction": {0: [0, 0, 1], 7: [0, 0, -1]}, "strength": 5}}
    film = film_of(scene_of({"transfer_function": points("white")}, light=light), volume(cube()))
    first, last = (film.at(frame).groups[0].light for frame in (0, 7))
    assert first is not None and last is not None
    assert first is film.groups[0].light
    assert first.stops == last.stops
    assert np.abs(first.radiance - last.radiance).max() > 0.1


def test_labels_scatter_light() -> None:
    """Two labels in a furnace: one is white, and the other one shows a part of the light."""
    labels = np.zeros((16, 16, 16), np.uint8)
    labels[4:12, 4:12, 4:8], labels[4:12, 4:12, 8:12] = 1, 2
    look = {"labels": {"colors": {1: "white", 2: "#808080"}, "opacity": 1, "show": [1, 2]}}
    radiance = drawn(stage_of(scene_of(look), make_volume(labels, np.eye(4), "labels")), number=0)
    colors = colors_of(radiance, 0.99)
    assert colors.max() < 1.01
    assert colors.min() < 0.5
    assert colors.max() > 0.9


def test_open_exposure_leaves_an_even_light_as_it_is() -> None:
    """Convex matter in an even white light has about the exposure 0, and half of the light asks for one stop more."""
    grid = stage_of(scene_of({"transfer_function": points("gray")}, light={"environment": WHITE_SKY}), volume(cube()))
    assert grid.groups[0].light is not None and abs(grid.groups[0].light.stops) < 0.3
    half = (0.735357,) * 3  # linear 0.5
    scene = scene_of(
        {"transfer_function": points("gray")}, light={"environment": {"top": half, "horizon": half, "bottom": half}}
    )
    dim = stage_of(scene, volume(cube())).groups[0].light
    assert dim is not None
    assert dim.stops - grid.groups[0].light.stops == pytest.approx(1, abs=1 / 32)


@pytest.mark.parametrize(
    ("values", "num_absent", "is_seen"),
    [
        pytest.param(np.ones((1, 1, 1)), 0, True, id="one voxel"),
        pytest.param(np.ones((1, 40, 1)), 0, True, id="a row"),
        pytest.param(np.zeros((5, 5, 5)), 0, False, id="nothing visible"),
        pytest.param(np.full((5, 5, 5), np.nan), 125, False, id="no data"),
        pytest.param(np.where(np.indices((9, 9, 9)).sum(axis=0) % 2, np.nan, 1.0), 364, True, id="half of the data"),
    ],
)
def test_small_and_empty_volumes(values: Float64, num_absent: int, is_seen: bool) -> None:
    light = {"environment": "outdoor", "key": {"strength": 1e6, "radius": 0.1}}
    matter = make_volume(values.astype(np.float32), np.eye(4), "matter", num_absent=num_absent)
    stage = stage_of(scene_of({"transfer_function": points("white")}, light=light), matter)
    radiance, found = drawn(stage), stage.groups[0].light
    assert found is not None
    assert np.isfinite(found.radiance).all()
    assert (found.stops < -15) == is_seen
    assert np.isfinite(radiance).all()
    assert (radiance[..., :3].max() > 0.1) == is_seen
    assert radiance[..., :3].max() < 4


def test_nothing_visible_has_the_exposure_0() -> None:
    stage = stage_of(scene_of({"transfer_function": points("gray")}), volume(cube()))
    (layer,) = stage.layers
    empty = Matter(volume(np.zeros((5, 5, 5), np.float32)), layer.optics)
    sources = sources_of(LightSpec())
    assert choose_stops(compute_radiance_grid([empty], sources), sources) == 0


def test_sources_are_linear_light() -> None:
    sources = sources_of(LightSpec(up=(0.0, 2.0, 0.0), key=KeySpec((0.0, 0.0, 1e20), (1.0, 0.5, 0.0), 2.0, 5.0)))
    assert sources.up == (0, 1, 0) and sources.key == (0, 0, 1) and sources.key_radius == 5
    np.testing.assert_allclose(sources.key_irradiance, [2 * np.pi, 2 * np.pi * 0.2140411, 0], rtol=1e-6)
    assert sources.scattering == 1 and sources_of(LightSpec(scattering=0.25)).scattering == 0.25
    a0, a1, a2 = sources.environment  # at the cosines 1, 0 and -1
    studio = LightSpec().environment
    for found, color in ((a0 + a1 + a2, studio.top), (a0 - a2 / 2, studio.horizon), (a0 - a1 + a2, studio.bottom)):
        np.testing.assert_allclose(found, linear_of_srgb(color), rtol=1e-12)


@pytest.mark.parametrize(
    ("sections", "problem"),
    [
        ({"shading": {}}, "shading: contradicts light"),
        ({"mode": "maximum"}, "light: contradicts mode: maximum"),
        ({"blend": "add"}, "light: contradicts blend: add"),
        ({"splat": {"footprint": "gaussian"}}, "light: needs footprint: integrated"),
        ({"splat": {"footprint": "gouraud"}}, "light: needs footprint: integrated"),
        ({"light": {"environment": "moon"}}, "light.environment: unknown value"),
        ({"light": {"key": {"strength": 1e30}}}, "light.key.strength: out of range"),
        ({"light": {"key": {"direction": [0, 0, 0]}}}, "light.key.direction: no direction"),
        ({"light": {"key": {"strength": math.nan}}}, "light.key.strength: not a finite number"),
        ({"light": {"environment": {"top": [math.nan, 0, 0]}}}, "light.environment.top.0: not a finite number"),
        ({"light": {"environment": {"horizon": [1e30, 0, 0]}}}, "light.environment.horizon.0: out of range"),
        ({"light": {"exposure": math.inf}}, "light.exposure: not a finite number"),
        ({"light": {"up": [0, math.nan, 1]}}, "light.up.1: not a finite number"),
    ],
)
def test_sections_that_contradict_a_light_are_named(sections: dict[str, Any], problem: str) -> None:
    layer = {"transfer_function": points("white", [{"value": 0.0, "opacity": 0.0}, {"value": 1.0, "opacity": 0.5}])}
    with pytest.raises(SceneError) as caught:
        parse_scene(scene_of(layer) | sections, base=Path())
    assert problem in str(caught.value)


def test_a_volume_of_the_list_with_shading_is_named() -> None:
    layer = {"transfer_function": points("white")}
    with pytest.raises(SceneError, match=r"volumes\.1\.shading: contradicts light"):
        parse_scene(scene_of(layer, layer | {"shading": {}}), base=Path())


def test_voxels_that_are_colors_are_refused() -> None:
    with pytest.raises(SceneError, match="voxels that are colors have no albedos"):
        parse_scene(scene_of({"component": "color", "transfer_function": points("white")}), base=Path())


def test_pixels_are_compared_as_they_are_shown() -> None:
    """A step from black to a dark grey is seen, and a smaller step between two light greys is not."""
    dark, light = np.ones((2, 4, 8, 4), np.float32)
    dark[..., :3], light[..., :3] = 0.0, 0.6
    dark[:, 4:, :3], light[:, 4:, :3] = 0.01, 0.65
    for image, is_linear, expected in ((dark, True, 8), (light, True, 0), (dark, False, 0), (light, False, 8)):
        marks = np.zeros(image.shape[:2], np.uint8)
        kernels().mark_contrasts(
            image=image, threshold=0.045, is_linear=is_linear, marks=marks, first_row=0, end_row=len(image)
        )
        assert np.count_nonzero(marks) == expected


def test_square_roots_are_near_srgb() -> None:
    """As `shown.h` says."""
    encoded = np.arange(4096) / 4095
    assert np.abs(np.sqrt(linear_of_srgb(encoded)) - encoded).max() < 0.04


def test_lines_and_texts_keep_their_colours_over_linear_light() -> None:
    stage = stage_of(scene_of({"transfer_function": points("white")}), volume(cube()))
    image, color = np.zeros((48, 48, 4), np.float32), np.array([0.25, 0.5, 0.75, 1.0], np.float32)
    patch = Patch(np.broadcast_to(color, (4, 4, 4)) * np.float32(1), 0, 0)
    draw_annotation(image, [patch], is_linear=True)
    shown = quantize(image, (0.0, 0.0, 0.0), is_linear=True)
    np.testing.assert_array_equal(shown[0, 0], [64, 128, 191])
    lit, plain = np.zeros((2, 48, 48, 4), np.float32)
    draw_lines(make_outline(stage.layers[0].volume), view_of(stage, 0), lit, is_linear=True)
    draw_lines(make_outline(stage.layers[0].volume), view_of(stage, 0), plain)
    np.testing.assert_array_equal(lit[..., 3], plain[..., 3])
    brightest = np.unravel_index(plain[..., 3].argmax(), plain.shape[:2])
    alpha = plain[brightest][3]
    np.testing.assert_allclose(lit[brightest][:3] / alpha, linear_of_srgb(plain[brightest][:3] / alpha), atol=0.03)


@pytest.mark.parametrize("affine", [np.eye(4), TURNED])
def test_radiance_is_looked_up_at_the_place_of_a_sample(affine: Float64) -> None:
    """With a radiance that is the position in the world, white matter shows where its surface is."""
    stage = stage_of(scene_of({"transfer_function": points("white")}), volume(cube(), affine))
    (group,) = stage.groups
    light = group.light
    assert light is not None and group.bricks is not None
    z, y, x = np.indices(light.radiance.shape[:3]) + 0.5
    places = light.origin + light.cell * np.stack([x, y, z], axis=-1)
    radiance = np.zeros_like(light.radiance)
    radiance[..., :3] = 0.5 + (places - group.volume.centre) / 100
    bricks = replace(group.bricks, light=light._replace(radiance=radiance))
    shown = drawn(replace(stage, groups=(replace(group, bricks=bricks),)), number=NUMBER)
    view = view_of(stage, NUMBER)
    seen = np.argwhere(shown[..., 3] > 0.999)
    assert len(seen) > 300
    found = group.volume.centre + (shown[tuple(seen.T)][:, :3] - 0.5) * 100
    inside = (found - group.volume.centre) @ np.linalg.inv(affine[:3, :3]).T  # of a cube with this half width
    # A pixel may have several sides of the cube.
    assert np.median(np.abs(np.abs(inside).max(axis=1) - 7.5)) < 0.4
    # And it is on the ray of the pixel.
    right, up, backward = view.view_from_world(found).T
    across, down = view.scale_px * right / -backward + 24, 24 - view.scale_px * up / -backward
    np.testing.assert_allclose(np.median(np.abs(across - seen[:, 1] - 0.5)), 0, atol=0.2)
    np.testing.assert_allclose(np.median(np.abs(down - seen[:, 0] - 0.5)), 0, atol=0.2)


def test_pictures_agree_with_paths_of_light() -> None:
    """Two volumes on grids of their own, against Monte Carlo; errors are measured without the noise of the paths."""
    light = {"environment": "outdoor", "key": {"direction": [1, -1, 1], "strength": 2}, "exposure": -1}
    looks = [
        {"transfer_function": points(color, opacities)} for color, opacities in (("#c08040", SOLID), ("white", CLEAR))
    ]
    scene = scene_of(*looks, light=light, output={"file": "film.mp4", "size": [32, 32]})
    stage = stage_of(scene, volume(blobs(1, 32)), volume(blobs(2, 32), TURNED))
    radiance = drawn(stage).reshape(-1, 4)[:, :3]
    assert stage.scene.light is not None
    layers = [TrueLayer(each.volume, each.optics, weight=each.spec.weight) for each in stage.layers]
    tracer, pixels = PathTracer(layers, sources_of(stage.scene.light)), np.arange(32 * 32)
    view = view_of(stage, NUMBER)
    truth = light_of_pixels(tracer, view, pixels, seed=(1,), standard_error=0.0, most_paths=288).halves[..., :3] / 2
    error = ((radiance - truth[0]) * (radiance - truth[1])).mean() / (truth[0] * truth[1]).mean()
    assert radiance.mean() == pytest.approx(truth.mean(), rel=0.05)
    # The blobs are as small as cells.
    assert error < 0.2**2


def test_cells_are_as_fine_as_visible_matter_allows() -> None:
    """A small cube in a long volume; a cube in a long bar that clipping leaves; and a far volume that shows nothing."""
    bar, small = np.ones((9, 9, 300), np.float32), np.zeros((9, 9, 300), np.float32)
    small[2:7, 2:7, 200:206] = 1
    clip = [{"box": [[200, 0, 0], [220, 9, 9]], "invert": True}]
    layer, far = {"transfer_function": points("white")}, np.eye(4) + 5000 * np.eye(4, k=3)
    nothing = volume(np.zeros((9, 9, 9), np.float32), far, "nothing")
    for scene, volumes, cell in (
        (scene_of(layer), [volume(bar)], 2.5),
        (scene_of(layer), [volume(small)], 1.0),
        (scene_of(layer, clip=clip), [volume(bar)], 1.0),
        (scene_of(layer, layer), [volume(small), nothing], 1.0),
    ):
        light = stage_of(scene, *volumes).groups[0].light
        assert light is not None and light.cell == cell


def test_light_of_the_first_frame_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A later process finds it, with the same bytes; other light, other matter and other places are found anew."""
    light = {"key": {}, "surface": 0.5}
    scene, matter = scene_of({"transfer_function": points("orange")}, light=light), volume(blobs())
    plain = drawn(stage_of(scene, matter))
    with caching_in(tmp_path):
        first = drawn(stage_of(scene, matter))
        with monkeypatch.context() as solve:
            solve.setattr("renderer.lighting.scene_light.compute_radiance_grid", None)
            later = drawn(stage_of(scene, matter))
            others = [
                (scene | {"light": light | {"scattering": 0.5}}, matter),
                (scene_of({"transfer_function": points("red")}, light=light), matter),
                (scene | {"clip": [{"plane": {"point": [0, 0, 9], "normal": [0, 0, 1]}}]}, matter),
                (scene, volume(blobs(2))),
                (scene, volume(blobs(), TURNED)),
            ]
            for other, changed in others:
                with pytest.raises(TypeError, match="not callable"):
                    stage_of(other, changed)
    np.testing.assert_array_equal(first, plain)
    np.testing.assert_array_equal(later, plain)


def test_light_reaches_a_face_that_clipping_cuts() -> None:
    """Matter that is clipped away casts no shadow: from above, the cut face is as bright as the top was."""
    key = {"environment": {"top": "black", "horizon": "black", "bottom": "black"}, "key": {"direction": [0, 0, 1]}}
    camera = {"path": {"type": "turntable", "frames": 8, "elevation": 90}, "distance": 100}
    clip = [{"plane": {"point": [0, 0, 11.5], "normal": [0, 0, 1]}}]
    pictures = []
    for sections in ({}, {"clip": clip}):
        scene = scene_of({"transfer_function": points("white")}, light=key | {"exposure": 0}, camera=camera, **sections)
        pictures.append(drawn(stage_of(scene, volume(cube())))[20:28, 20:28, 0].mean())
    assert pictures[1] == pytest.approx(pictures[0], rel=0.2)


def test_the_time_of_the_light_is_told() -> None:
    layer = {"transfer_function": points("white")}
    for light, is_told in ((EVEN, True), (None, False)):
        assert ("light" in stage_of(scene_of(layer, light=light), volume(cube())).seconds) == is_told
