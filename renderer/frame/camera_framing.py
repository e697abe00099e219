"""Frame a film: the target of its camera, its distance, and its place in the picture beside the annotation.

Entries of an annotation leave rectangles of the picture free. The object is drawn in the rectangle in which it is
largest, with the target in the middle. The entries depend on the distance, as a scale bar does, so that both are found
in turn.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from renderer.annotation import (
    LEAST_SHARE,
    Box,
    FrameFacts,
    LabelPoints,
    NamedLabel,
    film_facts,
    frame_facts,
    free_rooms,
    label_points,
    named_labels,
    taken_boxes,
)
from renderer.errors import Problem
from renderer.frame.preparation import StageMaker, points_in_frame
from renderer.layers import Layer, parts_over_frames
from renderer.scene import (
    CameraPath,
    CameraSpec,
    FilmScene,
    FlightPath,
    HoldPath,
    PathSequence,
    Vector,
    min_tolerance,
    raise_problems,
)
from renderer.splats import GAUSSIAN_CUTOFF
from renderer.view import (
    WHOLE_PICTURE,
    Room,
    corners_around,
    fit_distance,
    least_distance,
    make_view,
    visible_centre,
    volume_corners,
)
from renderer.volume import Float64

# The largest number of frames of a film in motion whose visible cells decide how far away the camera is. The layers of
# each such frame have to be made.
_MOST_SAMPLED_LAYERS = 9
# The largest number of frames of a film in motion whose cameras decide how far away the camera is.
_MOST_SAMPLED_CAMERAS = 1000
# The longest side, in voxels, of a volume that counts as small. Its splats may reach beyond the margin of the picture,
# so that the camera is moved away from it. Larger volumes are framed alike for all footprints, so that their pictures
# can be compared.
_MAX_SIDE_OF_SMALL = 24
# The PSNR in decibels with which the annotation is tried, before the accuracy is known. No PSNR makes a wider text.
WIDEST_PSNR = 100.0
# The largest number of frames on which the annotation is tried before a film is drawn. It took 0.3 ms a frame.
_MOST_TRIED = 500
# The largest number of times that the room beside the annotation is found. Each time, entries such as a scale bar fit
# the distance that the room before led to. Five scenes took two or three times.
_MOST_ROUNDS = 6


def frame_camera(scene: FilmScene, maker: StageMaker, layers: tuple[Layer, ...]) -> tuple[CameraSpec, float]:
    """Return the camera of the first frame with its target, distance and shift; all frames hold what any frame shows.

    The scene's own target, distance and shift are kept. Cells that hardly show are left out of the framing. The second
    value is the share of a picture that these cells would add.
    """
    camera, framed = scene.at(0).camera, scene.at(0).camera
    frames_of: dict[CameraSpec, list[int]] = {}
    for frame in _sampled(scene, _MOST_SAMPLED_CAMERAS):
        frames_of.setdefault(scene.at(frame).camera, []).append(camera.path_frame(frame))
    if camera.distance is not None:
        framed = replace(camera, shift=camera.shift or (0.0, 0.0))
    if all(isinstance(each.target, tuple) and each.distance is not None for each in frames_of):
        return framed, 0.0
    found = [points_in_frame(scene.at(0), layers), *_other_points(scene, maker, layers)]
    points, left_out = np.concatenate([each for each, _ in found]), max(part for _, part in found)
    framed = replace(framed, target=_target(camera, layers, points))
    if camera.distance is not None:
        return framed, left_out
    fit = _fit(scene, layers, points, framed, frames_of)
    if camera.shift is not None:
        across, up = (1.0 - 2.0 * abs(share) for share in camera.shift)
        return replace(framed, distance=fit(Room(right=max(across, 0.1), bottom=max(up, 0.1)))), left_out
    room, distance = _room_beside(scene, layers, framed, fit)
    return replace(framed, distance=distance, shift=room.shift), left_out


def _fit(
    scene: FilmScene,
    layers: Sequence[Layer],
    points: Float64,
    camera: CameraSpec,
    frames_of: dict[CameraSpec, list[int]],
) -> Callable[[Room], float]:
    """Return a function that finds the least distance at which points are in a part of the picture on all frames.

    camera: the camera of the first frame, with its target. frames_of: the cameras of the film, each with its frames.
    """
    target, size, volume = camera.target, scene.output.size, layers[0].volume
    assert isinstance(target, tuple)

    def fit(room: Room) -> float:
        if len(frames_of) == 1:
            distance = fit_distance(scene.at(0).camera, points, target, size, room=room)
        else:
            distance = max(
                least_distance(
                    each,
                    points,
                    each.target if isinstance(each.target, tuple) else target,
                    size,
                    frames=frames,
                    room=room,
                )
                for each, frames in frames_of.items()
            )
        if scene.needs_opengl and max(volume.shape_xyz) <= _MAX_SIDE_OF_SMALL:
            reach = GAUSSIAN_CUTOFF * scene.at(0).splat.sigma - 0.5
            whole = corners_around(volume, points, reach)
            distance = max(distance, fit_distance(scene.at(0).camera, whole, target, size, margin=0.0, room=room))
        return distance

    return fit


def _room_beside(
    scene: FilmScene, layers: Sequence[Layer], camera: CameraSpec, fit: Callable[[Room], float]
) -> tuple[Room, float]:
    """Return the part of the picture in which the object is drawn, beside the annotation, and the camera's distance.

    fit: the function that finds the distance at which the object is in a part of the picture.
    """
    annotation, room, distance = scene.at(0).annotation, WHOLE_PICTURE, fit(WHOLE_PICTURE)
    taken: dict[str, Box] = {}
    is_beside = annotation.has_patches and annotation.layout == "beside" and not _is_flight(camera.path)
    names = names_of(scene, layers)[0] if is_beside else []
    for _ in range(_MOST_ROUNDS if is_beside else 0):
        now = _taken(scene, layers, names, replace(camera, distance=distance, shift=room.shift), taken)
        if now == taken:
            break
        taken = now
        if not (rooms := free_rooms(taken.values(), scene.output.size)):
            (width, height), share = scene.output.size, LEAST_SHARE
            got = f"{len(taken)} entries in a picture of {width} x {height} pixels"
            expected = f"a free rectangle of {round(share * width)} x {round(share * height)} pixels"
            hint = "fewer entries, a smaller size, or layout: over, which puts them over the object"
            raise_problems([Problem("annotation", "leaves no room for the object", got, expected, hint)])
        distance, room = min((fit(each), each) for each in rooms)
    return room, distance


def _is_flight(path: CameraPath) -> bool:
    """Return whether the scene places the eye and its target itself, on the whole path."""
    pieces = path.pieces if isinstance(path, PathSequence) else (path,)
    return any(isinstance(each, FlightPath) for each in pieces) and all(
        isinstance(each, (FlightPath, HoldPath)) for each in pieces
    )


def _taken(
    scene: FilmScene,
    layers: Sequence[Layer],
    names: Sequence[NamedLabel],
    camera: CameraSpec,
    before: dict[str, Box],
) -> dict[str, Box]:
    """Return the box of each entry of the annotation in the pictures of all kinds, joined with its box `before`.

    names: the labels that are named beside the object. camera: the camera of the first frame, framed.
    """
    assert isinstance(camera.target, tuple) and camera.distance is not None
    found, num_frames = dict(before), scene.num_frames
    for kind in scene.output.kinds:
        facts, shown = film_facts(scene.at(0), layers, kind.at(0), names), list[FrameFacts]()
        for frame in tried_frames(range(num_frames)):
            at = scene.at(frame).camera
            view = make_view(
                replace(at, shift=camera.shift),
                frame,
                camera.target,
                at.distance or camera.distance,
                scene.output.size,
            )
            shown.append(frame_facts(scene, layers, view, frame, kind).with_accuracy(WIDEST_PSNR))
        for key, box in taken_boxes(scene.at(0).annotation, facts, shown).items():
            found[key] = box.joined(found.get(key, box))
    return found


def names_of(scene: FilmScene, layers: Sequence[Layer]) -> tuple[list[NamedLabel], LabelPoints]:
    """Return the labels that the annotation of a film names, and points on all labels. layers: of the first frame."""
    first = scene.at(0)
    if first.annotation.names is None:
        return [], ()
    points = label_points(layers)
    return named_labels(layers, points, first.camera.path, first.annotation.name_sides), points


def tried_frames(frames: Sequence[int]) -> list[int]:
    """Return the frames on which the annotation is tried before a film is drawn, with the first and the last."""
    return spread(frames, _MOST_TRIED)


def spread(frames: Sequence[int], most: int) -> list[int]:
    """Return at most this number of frames, evenly spread, with the first and the last."""
    num = min(most, len(frames))
    return [frames[k * (len(frames) - 1) // max(1, num - 1)] for k in range(num)]


def _target(camera: CameraSpec, layers: Sequence[Layer], points: Float64) -> Vector:
    """Return the target of a camera: the one in the scene, else the centre of the visible cells or of the volumes.

    points: the corners of visible cells that must be in frame.
    """
    if camera.target == "visible":
        return visible_centre(points)
    if camera.target is not None:
        return camera.target
    if len(layers) > 1:
        return visible_centre(np.concatenate([volume_corners(layer.volume) for layer in layers]))
    x, y, z = layers[0].volume.centre
    return float(x), float(y), float(z)


def _other_points(scene: FilmScene, maker: StageMaker, layers: tuple[Layer, ...]) -> Iterator[tuple[Float64, float]]:
    """Yield what `points_in_frame` returns, for some frames of a film in motion, without the first frame.

    layers: the layers of the first frame.
    """
    tolerance, known = min_tolerance(scene.error), [layer.digest for layer in layers]
    for frame in _sampled(scene, _MOST_SAMPLED_LAYERS)[1:] if scene.moves else ():
        sampled = scene.at(frame)
        if maker.digests_of(sampled, tolerance) != known:  # without shading, which takes time and makes no cell visible
            sampled = sampled.with_layers(shading=None)
        yield points_in_frame(sampled, maker.layers_of(sampled, tolerance))


def framing_note(scene: FilmScene) -> str | None:
    """Return a sentence on the frames by which a film is framed, if its layers change and other frames may show more.

    Return None if the frames cannot show more, or the scene gives the camera's target and distance.
    """
    frames, camera = _sampled(scene, _MOST_SAMPLED_LAYERS), scene.at(0).camera
    is_open = camera.distance is None or not isinstance(camera.target, tuple)
    layers = enumerate(scene.film_layers)
    changes = any(
        layer.map(lambda each: each.volume).changing_frames or parts_over_frames(scene, number).changing_frames
        for number, layer in layers
    )
    if not (is_open and changes and len(frames) < scene.num_frames):
        return None
    return f"framed by the voxels visible on {len(frames)} of {scene.num_frames} frames"


def _sampled(scene: FilmScene, num: int) -> list[int]:
    """Return about `num` frames of a film, among them key frames; frame 0 alone if nothing moves."""
    if not scene.moves:
        return [0]
    frames = sorted({0, *scene.key_frames, *range(0, scene.num_frames, max(1, scene.num_frames // num))})
    return spread(frames, num)
