"""Clip planes and boxes: what a scene may say of them, and where they are in index space and along rays."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from brickwork import AFFINES, batch_of, bricks_of, hills, level_cut, placed, transfer_of, view_of
from small_scene import small_tree

from renderer.errors import SceneError
from renderer.readers import read_volume
from renderer.scene import MAX_CLIPS, ClipSpec, PlaneSpec, Scene, parse_scene
from renderer.truth import keep_parts, pixel_centres, rays_through
from renderer.view import View, are_clipped_away, place_clips, visible_bricks
from renderer.volume import Bools, Float64, Volume

PLANE = {"plane": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
BOX = {"box": [[0, 0, 0], [1, 2, 3]]}


def parse(**sections: Any) -> Scene:
    return parse_scene(small_tree(**sections), base=Path())


def complaints(**sections: Any) -> list[tuple[str, str]]:
    with pytest.raises(SceneError) as caught:
        parse(**sections)
    return [(problem.path, problem.what) for problem in caught.value.problems]


def test_defaults_of_a_clip_plane() -> None:
    plane = PlaneSpec((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert parse(clip=[PLANE]).clip == (ClipSpec(plane, None, "object", invert=False),)
    assert parse().clip == parse(clip=[]).clip == ()


def test_all_mistakes_are_told_at_once() -> None:
    flat = {"point": [0, 0, 0], "normal": [0, 0, 0]}
    clip: list[Any] = [{}, PLANE | BOX, {"plane": flat}, {"box": [[0, 5, "a"], [1, 2, 0]]}, 3, BOX | {"fixed": "x"}]
    assert complaints(clip=clip) == [
        ("clip.0", "nothing to clip with"),
        ("clip.1.box", "contradicts clip.1.plane"),
        ("clip.2.plane.normal", "no direction"),
        ("clip.3.box.0.2", "not a number"),
        ("clip.3.box.1.1", "an empty box"),
        ("clip.4", "not a mapping"),
        ("clip.5.fixed", "unknown value"),
    ]
    assert complaints(clip=[BOX] * (MAX_CLIPS + 1)) == [("clip", "too many planes and boxes")]
    assert len(parse(clip=[BOX] * MAX_CLIPS).clip) == MAX_CLIPS


@pytest.mark.parametrize(
    ("section", "what"),
    [
        ({"splat": {"sigma": 0.5}}, "splats cannot be clipped"),
        ({"splat": {"footprint": "gouraud"}}, "splats cannot be clipped"),
        ({"annotation": {"octree": True}}, "lines cannot be clipped"),
    ],
)
def test_what_cannot_be_clipped(section: dict[str, Any], what: str) -> None:
    assert complaints(clip=[BOX], **section) == [("clip", what)]
    parse(clip=[], **section)
    assert parse(clip=[BOX], annotation={"bounds": True}).clip


def test_a_crop_may_leave_axes_out() -> None:
    source = {"name": "marschner_lobb", "shape": [4, 5, 6]}
    some, all_axes = (
        parse(volume={"procedural": source, "crop": crop}).layers[0].volume
        for crop in ({"z": [1, 3]}, [[0, 4], [0, 5], [1, 3]])
    )
    assert some.crop == (None, None, (1, 3))
    one, other = read_volume(some), read_volume(all_axes)
    np.testing.assert_array_equal(one.values, other.values)
    np.testing.assert_array_equal(one.world_from_index, other.world_from_index)
    assert complaints(volume={"procedural": source, "crop": {"y": [0, 6], "w": [0, 1]}}) == [
        ("volume.crop.w", "unknown key"),
        ("volume.crop.y", "outside the volume"),
    ]


# Geometry, against points that are tried one by one


def is_clipped(clip: ClipSpec, view: View, points: Float64) -> Bools:
    """Whether points in the world, [..., 3], are clipped away."""
    points = points if clip.fixed == "object" else (points - view.target) @ view.axes.T
    if clip.plane is not None:
        return np.asarray(((points - clip.plane.point) @ clip.plane.normal > 0) != clip.invert)
    assert clip.box is not None
    low, high = clip.box
    return np.asarray(np.all((points > low) & (points < high), axis=-1) != clip.invert)


def are_kept(view: View, points: Float64) -> Bools:
    return ~np.any([is_clipped(clip, view, points) for clip in view.clip], axis=0)


def random_clips(rng: np.random.Generator, volume: Volume, view: View, num: int) -> tuple[ClipSpec, ...]:
    """Planes and boxes of all kinds through the volume."""
    reach, clip = np.abs(volume.world_from_index[:3, :3]) @ volume.shape_xyz / 2, []
    for _ in range(num):
        is_fixed = rng.random() < 0.5
        middle = volume.centre if is_fixed else view.axes @ (volume.centre - view.target)
        plane = PlaneSpec(triple(middle + 0.4 * reach * rng.uniform(-1, 1, 3)), triple(rng.normal(size=3)))
        corners = middle + reach * np.sort(rng.uniform(-1, 1, (2, 3)), axis=0)
        box = triple(corners[0]), triple(corners[1])
        chosen: Any = (plane, None) if rng.random() < 0.4 else (None, box)
        clip.append(ClipSpec(*chosen, "object" if is_fixed else "camera", bool(rng.random() < 0.2)))
    return tuple(clip)


def triple(values: npt.ArrayLike) -> tuple[float, float, float]:
    x, y, z = np.asarray(values).tolist()
    return x, y, z


@pytest.mark.parametrize("affine", AFFINES)
def test_points_are_kept_in_slabs_and_not_in_boxes(affine: str) -> None:
    rng = np.random.default_rng(len(affine))
    volume = placed(np.zeros((20, 30, 40), np.uint8), AFFINES[affine])
    view = view_of(volume, "perspective")
    points = rng.uniform(-0.5, 0.5, (4000, 3)) * volume.shape_xyz
    in_world = points @ volume.world_from_index[:3, :3].T + volume.centre
    for num in (1, 1, 2, 3, 6):
        view = replace(view, clip=random_clips(rng, volume, view, num))
        clip = place_clips(volume, view.clip, view)
        assert clip is not None
        kept = np.ones(len(points), np.bool_)
        for slab in clip.slabs:
            kept &= in_slab(slab, points)
        for box in clip.boxes:
            kept &= ~np.all([in_slab(slab, points) for slab in box], axis=0)
        np.testing.assert_array_equal(kept, are_kept(view, in_world))
        # No box of which anything is kept counts as clipped away.
        corners = points[:600].reshape(200, 3, 3)
        bounds = np.stack([corners.min(axis=1), corners.max(axis=1)], axis=1)
        inside = bounds[:, :1] + rng.random((200, 200, 3)) * (bounds[:, 1:] - bounds[:, :1])
        has_kept = are_kept(view, inside @ volume.world_from_index[:3, :3].T + volume.centre).any(axis=1)
        assert not np.any(are_clipped_away(clip, bounds) & has_kept)


def in_slab(slab: Float64, points: Float64) -> Bools:
    height = points @ slab[:3]
    return np.asarray((height > slab[3]) & (height < slab[4]))


@pytest.mark.parametrize("clip", [PLANE, PLANE | {"invert": True}, {"box": [[-9, -9, 15], [99, 99, 99]]}])
def test_bricks_that_are_clipped_away_are_not_drawn(clip: dict[str, Any]) -> None:
    bricks = bricks_of(placed(hills((32, 32, 32), 9.0)), transfer_of((0, (1, 1, 1), 0.1), (1, (1, 1, 1), 0.3)))
    view, batch = view_of(bricks.volume, "perspective"), batch_of(level_cut(bricks, 0), bricks)
    all_bricks = visible_bricks(batch, view)
    clip = clip | {"plane": {"point": [0, 0, 15.5], "normal": [0, 0, 1]}} if "plane" in clip else clip
    order = visible_bricks(batch, replace(view, clip=parse(clip=[clip]).clip))
    is_above = batch.cut.visible_bounds[all_bricks, 0, 2] > 15
    assert order.tolist() == all_bricks[is_above == bool(clip.get("invert", False))].tolist()
    assert len(all_bricks) == 2 * len(order) == 8


@pytest.mark.parametrize("camera", ["perspective", "orthographic", "inside"])
def test_parts_of_rays_are_those_that_the_truth_keeps(camera: str) -> None:
    rng = np.random.default_rng(len(camera))
    volume = placed(np.zeros((20, 30, 40), np.uint8), AFFINES["oblique"])
    view = view_of(volume, camera)
    origins, directions, starts = rays_through(volume.centre, view, pixel_centres(view.size)[:300:7])
    along = np.sort(rng.uniform(-60, 60, (len(starts), 300)), axis=1)
    points = origins[:, None] + along[..., None] * directions[:, None] + volume.centre
    num_kept = 0
    for num in (0, 1, 1, 2, 3, 6):
        view = replace(view, clip=random_clips(rng, volume, view, num))
        parts = keep_parts(view, volume.centre, origins, directions, starts)
        is_in_part = (along[..., None] > parts[:, None, :, 0]) & (along[..., None] < parts[:, None, :, 1])
        assert is_in_part.sum(axis=2).max() <= 1
        expected = along > starts[:, None]
        if num:
            expected &= are_kept(view, points)
        np.testing.assert_array_equal(is_in_part.any(axis=2), expected)
        num_kept += expected.any()
    assert num_kept >= 3


def test_a_ray_along_a_face_meets_the_box_or_not() -> None:
    volume = placed(np.zeros((8, 8, 8), np.uint8))
    view = view_of(volume, "orthographic", size=(2, 1))
    origins, directions = np.array([[0.0, 0, 0], [0, 9, 0]]), np.array([[-0.0, 0, 1]] * 2)
    box = ClipSpec(None, ((-1.0, -1.0, -1.0), (20.0, 8.0, 8.0)))
    for invert in (False, True):
        clip = replace(view, clip=(replace(box, invert=invert),))
        parts = keep_parts(clip, volume.centre, origins, directions, np.full(2, -50.0))
        lengths = np.clip(np.diff(np.clip(parts, -50, 50), axis=2), 0, None).sum(axis=(1, 2))
        np.testing.assert_allclose(lengths, [9, 0] if invert else [91, 100])
