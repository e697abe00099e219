"""Light from the camera, highlights, two-sided light and factors on extinction: the truth, and pictures against it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from brickwork import AFFINES, batch_of, bricks_of, hills, level_cut, ordered, placed, transfer_of, view_of
from film_stages import PLAIN
from ray_integrals import COLORFUL, EXACT, converged_image, integrate, look, oblique, riemann, volume
from stage_pictures import NUMBER, decibels, drawn_by_single_rays

from renderer.draw import BrickRasterizer
from renderer.frame import make_primitive, prepare_stage, view_of as view_of_frame
from renderer.scene import ShadingSpec, TurntablePath, with_tolerance
from renderer.transfer import make_transfer_function
from renderer.volume import Float64

SLANTED = (1.0, 2.0, 3.0)
KINDS = {
    "camera": ShadingSpec(0.2, 0.8, "camera"),
    "camera, specular": ShadingSpec(0.2, 0.5, "camera", 0.4, 7.0),
    "specular": ShadingSpec(0.2, 0.5, SLANTED, 0.4, 7.0),
    "silhouette": ShadingSpec(0.2, 0.5, SLANTED, 0.4, 7.0, silhouette=0.8),
    "two-sided": ShadingSpec(0.2, 0.5, SLANTED, 0.4, 7.0, two_sided=True),
    "gradients": ShadingSpec(1.0, 0.0, gradient_opacity=((0.2, 0.1), (1.5, 1.0), (2.5, 0.4))),
    "all": ShadingSpec(0.2, 0.5, "camera", 0.4, 7.0, True, ((0.2, 0.1), (1.5, 1.0))),
}
EACH_KIND = pytest.mark.parametrize("shading", KINDS.values(), ids=KINDS)


def down_a_ramp(values: list[float], shading: ShadingSpec, spacing: float = 1.0) -> Float64:
    """One orthographic ray along -z through voxels along z, of extinction 0.5 and the colour (0.5, 0.5, 0.5)."""
    column = volume(np.reshape(np.array(values, float), (-1, 1, 1)), np.diag([1.0, 1.0, spacing, 1.0]))
    grey = transfer_of((0, (0.5, 0.5, 0.5), 0.5))
    view = look((0.0, 0.0, 1.0), 100.0, (1, 1), projection="orthographic", path=TurntablePath(1, 0.0, 90.0))
    return integrate(column, grey, view, step_voxels=1.0, shading=shading)[0, 0]


TOWARDS, AWAY = [2.0, 1.0, 0.0], [0.0, 1.0, 2.0]  # the side of lower values is seen, or is behind
# Half of 60 degrees, between the viewer above and this light.
AT_60_DEGREES = (float(np.sqrt(3)), 0.0, 1.0)


@pytest.mark.parametrize(
    ("values", "shading", "brightness"),
    [
        (TOWARDS, ShadingSpec(0.1, 0.4, "camera"), 0.05 + 0.2),
        (TOWARDS, ShadingSpec(0.1, 0.4, AT_60_DEGREES), 0.05 + 0.2 * 0.5),
        (TOWARDS, ShadingSpec(0.1, 0.4, (0.0, 0.0, -1.0)), 0.05),
        ([1.0, 1.0, 1.0], ShadingSpec(0.1, 0.4, AT_60_DEGREES), 0.05),
        (AWAY, ShadingSpec(0.1, 0.4, "camera", 0.3), 0.05),
        (AWAY, ShadingSpec(0.1, 0.4, "camera", 0.3, two_sided=True), 0.05 + 0.2 + 0.3),
        (TOWARDS, ShadingSpec(0.1, 0.4, AT_60_DEGREES, 0.3, 6.0), 0.05 + 0.2 * 0.5 + 0.3 * 0.75**3),
        (TOWARDS, ShadingSpec(0.0, 0.0, AT_60_DEGREES, 1.0, 0.5), 0.75**0.25),
        (TOWARDS, ShadingSpec(0.0, 0.0, AT_60_DEGREES, 1.0, 33.3), 0.75**16.65),
        (TOWARDS, ShadingSpec(0.1, 0.4, (0.0, 0.0, -1.0), 0.3), 0.05),
        ([1.0, 1.0, 1.0], ShadingSpec(0.1, 0.4, "camera", 0.3, two_sided=True), 0.05),
    ],
)
def test_a_plane_has_the_light_of_the_definition(values: list[float], shading: ShadingSpec, brightness: float) -> None:
    assert down_a_ramp(values, shading)[0] == pytest.approx(brightness * -np.expm1(-1.5), abs=EXACT)


@pytest.mark.parametrize(("spacing", "factor"), [(0.5, 1.0), (1.0, 0.6), (4.0, 0.3 + 0.3 / 7), (16.0, 0.3)])
def test_gradients_per_world_unit_multiply_extinction(spacing: float, factor: float) -> None:
    shading = ShadingSpec(1.0, 0.0, gradient_opacity=((0.125, 0.3), (1.0, 0.6), (2.0, 1.0)))
    alpha = down_a_ramp(AWAY, shading, spacing)[3]
    assert alpha == pytest.approx(-np.expm1(-0.5 * factor * 3 * spacing), abs=EXACT)


@EACH_KIND
@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_the_truth_is_the_limit_of_the_riemann_sum(shading: ShadingSpec, projection: str) -> None:
    noise = volume(np.random.default_rng(3).uniform(-1, 2, (4, 5, 6)), oblique())
    view = look(tuple(noise.centre), 9.0, (6, 5), field_of_view=50.0, projection=projection)
    image, _ = converged_image(noise, COLORFUL, view, tolerance=1e-6, shading=shading)
    sums = [riemann(noise, COLORFUL, view, num, shading) for num in (500, 8_000)]
    assert np.abs(sums[1] - image).max() < 1e-4
    assert np.sqrt(np.mean((sums[1] - image) ** 2)) < 0.2 * np.sqrt(np.mean((sums[0] - image) ** 2))


@EACH_KIND
@pytest.mark.parametrize("camera", ["perspective", "orthographic", "inside"])
def test_pictures_converge_to_the_truth(shading: ShadingSpec, camera: str) -> None:
    """In an oblique volume, by its bricks of voxels at any tolerance, and mostly by few pixels at a coarse one."""
    field = placed(100.0 * hills((20, 33, 40), 24.0), AFFINES["oblique"])
    transfer = transfer_of((0, (0.9, 0.2, 0.1), 0.0), (100, (0.1, 0.5, 1.0), 0.15))
    if shading.gradient_opacity:
        shading = replace(shading, gradient_opacity=((2.0, 0.1), (15.0, 1.0), (20.0, 0.4)))
    bricks, view = bricks_of(field, transfer, shading), view_of(field, camera, (40, 30))
    truth, _ = converged_image(field, transfer, view, tolerance=1e-6, shading=shading)
    assert truth[..., 3].max() > 0.2
    cut = level_cut(bricks, 0)
    with BrickRasterizer() as rasterizer:
        batch = batch_of(cut, bricks, step=1 / 16, shading=shading)
        image = rasterizer.rasterize([batch], [ordered(cut, view)], view)
    assert -10 * np.log10(np.mean((image - truth) ** 2)) > 80


@pytest.mark.parametrize("tolerance", [2.0, 0.02])
def test_scenes_draw_voxels_at_every_tolerance(tolerance: float) -> None:
    shading = ShadingSpec(0.3, 0.7, "camera", 0.3, gradient_opacity=((0.0, 0.2), (60.0, 1.0)))
    scene = with_tolerance(PLAIN.with_layers(shading=shading), tolerance)
    with prepare_stage(scene, clock=lambda: 0.0, num_threads=1) as stage:
        lod = make_primitive(stage).make_lod(tolerance, lambda _: None)
        assert lod.num_cells > 1
        assert not lod.batches[0].cut.levels.any()
        volume = stage.layers[0].volume
        transfer = make_transfer_function(scene.layers[0].transfer_function, volume.finest_spacing)
        truth, _ = converged_image(volume, transfer, view_of_frame(stage, NUMBER), tolerance=1e-5, shading=shading)
        assert decibels(drawn_by_single_rays(stage), truth) > (20 if tolerance > 1 else 55)
