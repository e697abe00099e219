"""Tests of VTK on hsplat's scenes: its finest pictures are near the truth, and its failures are reported."""

from __future__ import annotations

import math
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pixel_areas import coverage, turned
from ray_integrals import integrate
from vtk_peer import (
    Look,
    VtkMeasurement,
    VtkSetting,
    check_vtk,
    comparable,
    describe_vtk,
    look_of,
    measure_vtk,
    vtk_settings,
    with_transparent_border,
)

from renderer.accuracy import Truth
from renderer.errors import InputError
from renderer.film import over_background
from renderer.frame import prepare_stage
from renderer.readers import procedural_values
from renderer.scene import CameraSpec, ProceduralSource, Scene, TurntablePath, parse_scene
from renderer.transfer import TransferFunction
from renderer.truth import Convergence, PixelMeans, SceneRays, pixel_centres
from renderer.view import View, make_view
from renderer.volume import Float64, Volume, make_volume

SHAPE = (36, 30, 24)
BACKGROUND = (0.2, 0.4, 0.6)  # whole steps of 8 bits

# dB of VTK's finest settings. Seen: 57 to 58 and 49 to 53; 8 bits alone are 58.9, and a picture of this volume that
# fills the frame and is a tenth of a voxel aside has 54.6, a quarter 46.7.
NEAR = {"gpu": 54.0, "fixed point": 46.5}
FINEST = [VtkSetting(mapper, 0.5) for mapper in NEAR]


# No test depends on it.
CONVERGENCE = Convergence((), (), ())


def transfer(low: float = 0.0, high: float = 255.0, unit: float = 1.0) -> TransferFunction:
    """Return a transfer function that is transparent up to a fifth of the way from low to high."""
    values = low + (high - low) * np.array([0.0, 0.2, 0.5, 1.0])
    colors = np.array([[0.0, 0.0, 0.0], [0.2, 0.3, 0.9], [0.9, 0.6, 0.2], [1.0, 0.9, 0.8]])
    return TransferFunction(values, colors, np.array([0.0, 0.0, 0.05, 0.3]) / unit, unit)


def engine(dtype: str = "uint8", low: float = 0.0, high: float = 255.0, affine: Float64 | None = None) -> Volume:
    """Return a phantom whose grey values are stretched from [0, 255] to [low, high] of another type."""
    values = procedural_values(ProceduralSource("engine_block", SHAPE))
    stretched = low + values / 255.0 * ((high - low) * (1 - 1e-6)) if dtype != "uint8" else values
    return make_volume(np.ascontiguousarray(stretched.astype(dtype)), np.eye(4) if affine is None else affine, "engine")


def look(volume: Volume, size: tuple[int, int] = (72, 54), **camera: object) -> View:
    """Return a view of the whole volume, from above and from the side."""
    distance = 2.2 * float(np.linalg.norm(volume.world_from_index[:3, :3] @ np.array(volume.shape_xyz)))
    spec = CameraSpec(TurntablePath(1, 27.0, 31.0), **camera)  # type: ignore[arg-type]
    x, y, z = volume.centre
    return make_view(spec, 0, (x, y, z), distance, size)


def known(picture: Float64) -> PixelMeans:
    """Return a picture as a truth: VTK has one ray a pixel."""
    return PixelMeans(picture, np.zeros_like(picture))


def truth(volume: Volume, of: TransferFunction, view: View, frame: int = 0) -> Truth:
    exact = make_volume(volume.values.astype(np.float64), volume.world_from_index, volume.name)  # compiled once
    radiance = integrate(exact, of, view, step_voxels=1.0)
    return Truth(frame, known(over_background(radiance, BACKGROUND)), radiance[..., 3] > 0, CONVERGENCE)


def measured(volume: Volume, of: TransferFunction, *views: View) -> list[VtkMeasurement]:
    bordered = with_transparent_border(volume, of)
    truths = [truth(bordered, of, view, frame) for frame, view in enumerate(views)]
    return list(measure_vtk(bordered, Look(of, BACKGROUND), views, truths, settings=FINEST, repeats=0))


def require_near(measurements: list[VtkMeasurement]) -> None:
    for measurement in measurements:
        for frame, accuracy in enumerate(measurement.accuracies):
            assert accuracy.everywhere["psnr"] > NEAR[measurement.setting.mapper], frame


def oblique(columns: tuple[float, float, float]) -> Float64:
    """Return an affine that turns about two axes, scales columns, and lies far from the origin."""
    a, b = math.radians(25), math.radians(-40)
    about_z = np.array([[math.cos(a), -math.sin(a), 0], [math.sin(a), math.cos(a), 0], [0, 0, 1]])
    about_x = np.array([[1, 0, 0], [0, math.cos(b), -math.sin(b)], [0, math.sin(b), math.cos(b)]])
    affine = np.eye(4)
    affine[:3, :3] = about_z @ about_x * columns
    affine[:3, 3] = [1e5, -300.0, 2000.0]
    return affine


def test_pictures_are_near_the_truth_in_every_projection_and_shape() -> None:
    """They are so with the front cut off, with the eye inside and with nothing in view, too."""
    volume = engine()
    view = look(volume)
    depth = float(np.linalg.norm(view.eye - volume.centre))
    views = [
        view,
        look(volume, projection="orthographic"),
        look(volume, (50, 110)),
        replace(view, near=depth - 6),
        replace(look(volume, projection="orthographic"), near=depth - 6),
        make_view(CameraSpec(TurntablePath(1, 27.0), field_of_view=60), 0, (17.5, 14.5, 11.5), 30.0, (72, 54)),
        replace(view, axes=np.diag([-1.0, 1.0, -1.0]) @ view.axes, target=view.eye, distance=0.0),  # shows nothing
    ]
    measurements = measured(volume, transfer(), *views)
    require_near(measurements)
    assert all(measurement.accuracies[-1].everywhere["max_error"] < 1e-12 for measurement in measurements)


@pytest.mark.slow
def test_coarse_settings_are_worse() -> None:
    volume = with_transparent_border(engine(), transfer())
    view = look(volume)
    settings = [VtkSetting(mapper, *change) for mapper in NEAR for change in ((0.5, 1), (4.0, 1), (0.5, 1 / 2))]
    right = truth(volume, transfer(), view)
    found = list(measure_vtk(volume, Look(transfer(), BACKGROUND), [view], [right], settings=settings, repeats=3))
    assert [each.setting for each in found] == settings
    assert all(1 <= len(each.seconds[0]) <= 3 and min(each.seconds[0]) > 0 for each in found)
    for fine, coarse, quarter in (found[:3], found[3:]):
        psnrs = [each.overall.everywhere["psnr"] for each in (coarse, quarter)]
        assert max(psnrs) < fine.overall.everywhere["psnr"] - 3, fine.setting


@pytest.mark.slow
def test_more_rays_are_nearer_to_the_area_that_an_edge_covers() -> None:
    """Two opaque colours meet between two voxels. Seen with 1, 4 and 16 rays: 28 or more, 39 and 50 dB."""
    values = np.zeros((16, 48, 48), np.uint8)
    values[..., 24:] = 255
    plates = make_volume(values, np.eye(4), "plates")
    red, blue = (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)
    of = TransferFunction(np.array([0.0, 127.5, 127.5, 255.0]), np.array([red, red, blue, blue]), np.full(4, 20.0), 1.0)
    view = turned(plates, 20.0, 0.5, (40, 30))
    share = coverage(view, lambda x, _: x > 0)[..., None]
    right = Truth(0, known((1 - share) * red + share * blue), np.ones((30, 40), bool), CONVERGENCE)
    settings = [VtkSetting(mapper, 0.5, across) for mapper in NEAR for across in (1, 2, 4)]
    found = measure_vtk(plates, Look(of, None), [view], [right], settings=settings, repeats=0)
    psnrs = [each.overall.everywhere["psnr"] for each in found]
    for one, four, sixteen in (psnrs[:3], psnrs[3:]):
        assert one > 25 and four > one + 6 and sixteen > four + 6, psnrs


def test_settings_are_named_by_their_rays() -> None:
    names = [each.name for each in vtk_settings(scene_of().mode)]
    assert len({*names}) == len(names)
    assert {"gpu, step 0.5", "gpu, 4 rays, step 0.25", "fixed point, 16 rays, step 0.5"} <= {*names}
    assert {"gpu, 1/4 px, step 4", "fixed point, 1/16 px, step 2"} <= {*names}


def test_pictures_are_near_the_truth_wherever_the_volume_lies() -> None:
    """It is left-handed, sheared, tiny and far from the origin."""
    shear = np.array([[1, 0.3, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    volume = engine(affine=oblique((-1e-4, 1e-4, 2e-4)) @ shear)
    views = [look(volume), look(volume, projection="orthographic")]
    require_near(measured(volume, transfer(unit=volume.finest_spacing), *views))


@pytest.mark.parametrize(("dtype", "low", "high"), [("float32", -0.2, 0.2), ("float64", -4e307, 4e307)])
def test_pictures_are_near_the_truth_for_every_kind_of_voxel(dtype: str, low: float, high: float) -> None:
    volume = engine(dtype, low, high)
    require_near(measured(volume, transfer(low, high), look(volume)))


@pytest.mark.slow
def test_tables_resolve_a_narrow_window_and_a_step() -> None:
    """VTK looks values up in tables, wide enough for a window of 1 % of them: 8 bits would leave it 3 entries.

    Seen: 41.9 to 48.2 dB, 4 dB more with half the sample distance, so that it is the steps and not the tables.
    """
    colors = np.array([[1.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, 1]])
    window = np.array([0.0, 95.0, 95.5, 96.0, 1000.0]) * 1000
    volume = engine("float32", 0, 255e3)
    narrow = TransferFunction(window, colors, np.array([0.0, 0.0, 0.4, 0.0, 0.0]), 1.0)
    for measurement in measured(volume, narrow, look(volume)):
        assert measurement.overall.everywhere["psnr"] > 39
    step = TransferFunction(np.array([0.0, 90, 90, 255]), colors[:4], np.array([0.0, 0.0, 0.2, 0.2]), 1.0)
    for measurement in measured(engine(), step, look(engine())):
        assert measurement.overall.everywhere["psnr"] > 39


@pytest.mark.parametrize(
    ("dtype", "values", "extinctions", "expected"),
    [
        ("uint8", [0, 60, 255], [0, 0, 1], 3),  # the lowest
        ("uint8", [0, 60, 80], [1, 1, 0], 90),  # the highest
        ("int16", [40.4, 41.2, 41.6, 42.4], [1, 0, 0, 1], None),  # no whole number
        ("int16", [40, 40, 41, 41], [1, 0, 0, 1], 40),  # between steps: the lower one belongs to it
        ("uint8", [-2000, -1000, 200], [0, 1, 1], None),  # beyond its type
        ("int64", [-1e30, 0, 1e30], [0, 1, 1], None),
        ("float32", [40.1, 40.1, 41, 41], [1, 0, 0, 1], np.float32(40.55)),
        ("float64", [0, 50, 100], [1, 0, 1], 50),  # a single point
    ],
)
def test_the_border_is_transparent(dtype, values, extinctions, expected) -> None:
    volume = make_volume(np.resize(np.array([3, 90], dtype), (3, 3, 3)), np.eye(4), "scan")
    of = TransferFunction(np.array(values, float), np.zeros((len(values), 3)), np.array(extinctions, float), 1.0)
    if expected is not None:
        assert with_transparent_border(volume, of).values[0, 0, 0] == expected
        return
    with pytest.raises(InputError) as caught:
        with_transparent_border(volume, of)
    assert str(caught.value) == (
        "scan: the transfer function has no transparent value, which a comparison with VTK needs for "
        "the volume's border\n"
        f"  expected: an opacity of 0 at some value of type {dtype}"
    )


def test_a_thin_volume_has_no_border() -> None:
    with pytest.raises(InputError) as caught:
        comparable(scene_of(), make_volume(np.zeros((2, 5, 4), np.uint8), np.eye(4), "scan"))
    assert str(caught.value) == (
        "scan: the volume is too thin to be compared with VTK, which draws nothing beyond the outer voxel centres\n"
        "  got: 4 x 5 x 2\n"
        "  expected: at least 3 voxels along each axis"
    )


def test_only_the_border_changes() -> None:
    volume = engine(affine=oblique((0.7, 1.0, 2.0)))
    bordered = with_transparent_border(volume, transfer())
    inner = (slice(1, -1),) * 3
    assert bordered.values.dtype == volume.values.dtype
    assert np.array_equal(bordered.values[inner], volume.values[inner])
    border = np.ones(bordered.values.shape, bool)
    border[inner] = False
    assert set(bordered.values[border].tolist()) == {int(volume.values.min())}
    assert np.array_equal(bordered.world_from_index, volume.world_from_index)
    assert bordered.fingerprint != volume.fingerprint


def scene_of(**sections: object) -> Scene:
    tree = {
        "volume": {"procedural": {"name": "engine_block", "shape": list(SHAPE)}},
        "transfer_function": {"colormap": "gray", "range": [20, 230], "opacity": [[20, 0], [230, 0.3]]},
        "camera": {"path": {"type": "turntable", "frames": 1}},
        "output": {"file": "a.mp4", "size": [72, 54], "background": "white"},
    }
    return parse_scene({key: value for key, value in (tree | sections).items() if value is not None}, base=Path("/"))


def best_psnr(scene: Scene, volume: Volume) -> dict[str, float]:
    """Return the PSNR of the finest setting of each mapper that has the scene's mode."""
    scene, volume, _ = comparable(scene, volume)
    view = replace(look(volume), clip=scene.clip)
    width, height = view.size
    with prepare_stage(scene, clock=lambda: 0.0, num_threads=2, volumes=[volume]) as stage:
        rays = SceneRays(stage).integrate(view, pixel_centres(view.size), 0.25).reshape(height, width, 4)
    right = Truth(0, known(over_background(rays, scene.background)), rays[..., 3] > 0, CONVERGENCE)
    chosen = [each for each in vtk_settings(scene.mode) if each in FINEST]
    found = measure_vtk(volume, look_of(scene, volume), [view], [right], settings=chosen, repeats=0)
    return {each.setting.mapper: each.overall.everywhere["psnr"] for each in found}


# Colours that no window makes of gray.
COLORED = [{"value": 20, "color": "navy"}, {"value": 120, "color": "red"}, {"value": 230, "color": "white"}]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sections", "gpu", "fixed_point"),
    [
        ({"mode": "maximum", "transfer_function": {"points": COLORED}}, 51, 33),
        ({"mode": "minimum", "transfer_function": {"points": COLORED}}, 46, 30),
        ({"mode": "mean"}, 57, None),
        ({"mode": "mean", "transfer_function": {"colormap": "gray_r", "range": [20, 230]}}, 57, None),
        ({"shading": {"light": "camera", "specular": 0.3, "shininess": 8}}, 55, 33),
        ({"shading": {"light": "camera", "specular": 0.3, "shininess": 8, "two_sided": True}}, 53, 32),
    ],
)
def test_modes_and_light_are_near_the_truth(sections: dict[str, object], gpu: float, fixed_point: float | None) -> None:
    """Limits are 1 to 3 dB below what was seen."""
    affine = oblique((0.7, 1.0, 1.3))
    volume = engine(affine=affine)
    if sections.get("mode") == "minimum":  # whose rays would all meet air
        volume = make_volume(255 - volume.values, affine, "negative")
    found = best_psnr(scene_of(**sections), volume)
    assert found.keys() == ({"gpu"} if fixed_point is None else set(NEAR))
    assert found["gpu"] > gpu
    assert fixed_point is None or found["fixed point"] > fixed_point


def test_what_vtk_lacks_is_refused() -> None:
    plane = {"plane": {"point": [0, 0, 0], "normal": [1, 0, 0]}}
    cases: dict[str, dict[str, object]] = {
        "shading.light": {"shading": {"light": [1, 0, 0]}},
        "shading.gradient_opacity": {"shading": {"light": "camera", "gradient_opacity": [[0, 0], [9, 1]]}},
        "clip": {"clip": [plane]},
        "labels": {"labels": {}, "transfer_function": None},
        "mask": {"mask": {"procedural": {"name": "atlas", "shape": [9, 9, 9]}}},
        "mode": {"mode": {"type": "attenuation", "scale": 0.01, "zero": 0}},
        "mode.color_by": {"mode": {"type": "maximum", "color_by": "depth"}},
        "transfer_function": {"mode": "mean", "transfer_function": {"points": COLORED}},
    }
    for key, sections in cases.items():
        with pytest.raises(InputError) as caught:
            check_vtk(scene_of(**sections))
        assert str(caught.value).startswith(f"{key}: VTK cannot be compared: ")
    check_vtk(scene_of(mode="mean"))
    check_vtk(scene_of(shading={"light": "camera"}))


def test_vtk_describes_its_version_and_driver() -> None:
    from vtkmodules.vtkCommonCore import vtkVersion

    found = describe_vtk()
    assert found.keys() == {"version", "device"}
    assert found["version"] == vtkVersion.GetVTKVersion()
    assert found["device"] not in ("", "unknown")


def test_errors_of_vtk_end_the_measurement() -> None:
    """VTK itself would print an error and draw an empty picture: it cannot draw to a texture without texels."""
    volume = with_transparent_border(engine(), transfer())
    view = look(volume)
    right = truth(volume, transfer(), view)
    beyond = [VtkSetting("gpu", 0.5, 1e-9)]
    with pytest.raises(BrokenProcessPool):
        list(measure_vtk(volume, Look(transfer(), None), [view], [right], settings=beyond, repeats=0))
