"""Let the key light of a scene follow the camera: its direction on each frame is the direction to the viewer."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from renderer.scene import FilmScene, Motion, Scene, Vector, moving
from renderer.view.paths import make_view


def with_key_of_camera(scene: FilmScene) -> FilmScene:
    """Return the scene, with a direction for each frame in place of `light.key.direction: camera`."""
    light = scene.at(0).light
    if light is None or not light.follows_camera:
        return scene
    directions = tuple(_to_viewer(scene.at(frame), frame) for frame in range(scene.num_frames))
    direction: Any = moving(Motion(tuple(range(scene.num_frames)), directions, kind="direction"))

    def edit(sections: Scene) -> Scene:
        assert sections.light is not None and sections.light.key is not None
        key = replace(sections.light.key, direction=direction)
        return replace(sections, light=replace(sections.light, key=key))

    return scene.changed(edit)


def _to_viewer(scene: Scene, frame: int) -> Vector:
    """Return the direction to the viewer, which depends neither on the target nor on the distance of the camera."""
    x, y, z = make_view(scene.camera, frame, (0.0, 0.0, 0.0), 1.0, scene.output.size).axes[2].tolist()
    return x, y, z
