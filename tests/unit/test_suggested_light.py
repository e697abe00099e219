"""A suggested film in light that matter scatters: `--light` of `hsplat init`, and the scene that it makes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import tifffile
from kinds_of_data import ball

from hsplat_cli import main
from renderer.scene import AXES, ENVIRONMENTS, Scene, load_scene
from renderer.view import rotation_from_z_to

LAMP = (0.5, -0.8, 1.0)


def suggested_scene(*options: str) -> Scene:
    """Return the scene that `hsplat init` writes for a ball with the given options."""
    np.save("ball.npy", 200 * ball((0, 0, 0), 0.6, 24).astype(np.uint8))
    assert main.run(["init", "ball.npy", "--output", "scene.yaml", "--force", *options]) == 0
    return load_scene(Path("scene.yaml")).at(0)


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_an_environment_lights_the_scene(name: str, folder: Path) -> None:
    """In place of the shading; each has a key light, and the sun and the lamp have highlights."""
    light, (layer,) = (scene := suggested_scene("--light", name)).light, scene.layers
    assert light is not None and layer.shading is None
    assert light.environment == ENVIRONMENTS[name] and light.up == (0, 0, 1)
    assert light.surface == 0.9 and light.exposure is None
    assert light.key is not None and (light.specular > 0) == (name != "overcast")
    assert (light.key.direction == LAMP) == (name == "studio") and light.key.direction[2] > 0


def test_no_light_is_suggested_without_the_word(folder: Path) -> None:
    for options in ([], ["--light", "none"]):
        scene = suggested_scene(*options)
        assert scene.light is None and scene.layers[0].shading is not None


@pytest.mark.parametrize("axis", AXES)
def test_light_comes_from_above_for_every_axis(axis: str, folder: Path) -> None:
    """The light turns with the picture: it is as the camera of this axis sees the light of axis z."""
    light = suggested_scene("--light", "studio", "--axis", axis).light
    assert light is not None and light.key is not None
    assert light.up == AXES[axis]
    assert np.allclose(light.key.direction, rotation_from_z_to(AXES[axis]) @ LAMP, atol=1e-6)
    assert np.dot(light.key.direction, AXES[axis]) == pytest.approx(1.0)


def test_matter_without_surfaces_only_scatters(folder: Path) -> None:
    light = suggested_scene("--light", "studio", "--preset", "glow").light
    assert light is not None and (light.surface, light.specular) == (0.0, 0.0)


@pytest.mark.usefixtures("one_process")
def test_light_is_refused_where_nothing_scatters_it(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Channels add up, a shell is seen by its shading, and colours of voxels are no albedos."""
    suggested_scene()
    values = np.random.default_rng(1).integers(0, 255, (6, 2, 8, 8)).astype(np.uint8)
    tifffile.imwrite("channels.tif", values, imagej=True, metadata={"axes": "ZCYX"})
    tifffile.imwrite("colors.tif", values.repeat(2, 1)[:, :3].transpose(0, 2, 3, 1).copy(), photometric="rgb")
    capsys.readouterr()
    for arguments, told in (
        (["channels.tif"], "the light of channels adds up"),
        (["ball.npy", "--over", "ball.npy"], "a shell around another volume"),
        (["colors.tif"], "voxels that are colors have no albedos"),
    ):
        assert main.run(["init", *arguments, "--light", "studio"]) == 2, arguments
        text = capsys.readouterr().err
        assert told in text and "--light" in text, text
