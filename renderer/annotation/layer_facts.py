"""Find the facts that an annotation shows, such as the unit of lengths and the colours of labels, from layers."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from renderer.annotation.facts import AnnotationFacts, ColorBar, FrameFacts, Side
from renderer.annotation.names import NamedLabel
from renderer.layers import Layer
from renderer.scene import Color, FilmScene, PictureKind, Scene, moving_numbers, moving_values
from renderer.view import View

# The number of samples of a transfer function along its color bar.
_NUM_BAR_SAMPLES = 256


def film_facts(
    scene: Scene, layers: Sequence[Layer], kind: PictureKind, names: Sequence[NamedLabel] = ()
) -> AnnotationFacts:
    """Return the facts about a film that an annotation shows on all frames alike.

    scene: the scene at a frame, with its layers. kind: the kind of the pictures, with a background that does not move.
    names: the labels that are named beside the object.
    """
    background, volumes = kind.background_at(0), [layer.volume for layer in layers]
    axes = {volume.world_axes for volume in volumes}
    return AnnotationFacts(
        size=kind.size,
        background=None if background is None else background if len(background) == 2 else (background, background),
        unit=length_unit(layers) or "voxels",
        is_perspective=scene.camera.projection == "perspective",
        world_axes=axes.pop() if len(axes) == 1 else "",
        bars=tuple(_bars(layers)),
        legend=tuple(_legend(layers)),
        names=(_column(names, "left"), _column(names, "right")),
    )


def frame_facts(film: FilmScene, layers: Sequence[Layer], view: View, frame: int, kind: PictureKind) -> FrameFacts:
    """Return the facts about a frame that an annotation shows, without its accuracy.

    film: the scene of the whole film. layers, view: of the frame. kind: the kind of the picture.
    """
    volume = layers[0].volume
    side = (view.distance if view.projection == "perspective" else 1.0) / view.scale_px
    side *= view.size[0] / kind.size[0]
    right, up, away = ((x, y, z) for x, y, z in view.axes.tolist())
    at, time = layers[0].spec.volume.time, None
    if volume.times and isinstance(at, (int, float)):
        time = float(np.interp(at, range(len(volume.times)), volume.times))
    return FrameFacts(
        frame=frame,
        seconds=frame / film.output.frames_per_second,
        time=time,
        moving=moving_numbers(moving_values(film, frame)) if film.moves else {},
        world_per_pixel=side if length_unit(layers) else side / volume.finest_spacing,
        axes=(right, up, away),
    )


def _column(names: Sequence[NamedLabel], side: Side) -> tuple[tuple[str, Color], ...]:
    return tuple((each.text, each.color) for each in names if each.side == side)


def length_unit(layers: Sequence[Layer]) -> str:
    """Return the unit of world lengths, if all volumes have the same unit; else an empty text."""
    units = {layer.volume.length_unit for layer in layers}
    return units.pop() if len(units) == 1 else ""


def _bars(layers: Sequence[Layer]) -> Iterator[ColorBar]:
    """Yield the color bar of each layer that has one: its transfer function over the range of its control points."""
    for number, layer in enumerate(layers):
        mapping = layer.spec.transfer_function
        if mapping.labels is not None or layer.spec.volume.has_colors:
            continue
        low, high = float(layer.transfer.values[0]), float(layer.transfer.values[-1])
        if not low < high:
            continue
        is_log = low > 0 and getattr(mapping.mapping, "scale", "") == "log"
        scalars = np.geomspace(low, high, _NUM_BAR_SAMPLES) if is_log else np.linspace(low, high, _NUM_BAR_SAMPLES)
        colors, extinctions = layer.transfer.classify(scalars)
        opacities = -np.expm1(-extinctions * layer.transfer.unit)
        yield ColorBar(
            name=layer.spec.name,
            unit=layer.volume.value_unit,
            low=low,
            high=high,
            colors=tuple(map(tuple, colors.tolist())),
            opacities=() if layer.projection is not None else tuple(opacities.tolist()),
            layer=number,
            is_log=is_log,
        )


def _legend(layers: Sequence[Layer]) -> Iterator[tuple[str, tuple[float, float, float]]]:
    """Yield the names and colours in a legend: of labels and, if there are several volumes, of volumes without labels.

    A volume has the colour that its layer states, or the colour at its largest extinction.
    """
    for layer in layers:
        labels = layer.spec.transfer_function.labels
        if labels is not None:
            yield from ((style.name or f"label {style.value}", style.color) for style in labels.styles)
        elif len(layers) > 1:
            most_opaque = layer.transfer.colors[int(np.argmax(layer.transfer.extinctions))]
            red, green, blue = layer.spec.color or most_opaque.tolist()
            yield layer.spec.name or _file_name(layer), (red, green, blue)


def _file_name(layer: Layer) -> str:
    """Return the name of a layer's file without its folder, and its component if the layer has one."""
    name, component = Path(layer.volume.name).name, layer.spec.volume.component
    return name if component is None else f"{name}, component {component}"
