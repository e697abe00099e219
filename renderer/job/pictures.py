"""Make the pictures of a frame that the outputs of a film need, and say what the annotation over them shows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np

from renderer.annotation import AnnotationFacts, Annotator, ColorBar, FrameFacts, annotation_problems, draw_annotation
from renderer.draw import draw_lines, make_outline
from renderer.errors import Problem
from renderer.film import Picture, quantize, reduce_radiance
from renderer.frame import FilmStage, Frame, Stage, view_of
from renderer.job.record import FrameRecord
from renderer.scene import FilmScene, PictureKind, moving_numbers, moving_values, raise_problems
from renderer.view import View
from renderer.volume import Bools, Float32

_NUM_BAR_SAMPLES = 256
# Of the frames of a film, whose annotation is tried before any is drawn.
_MOST_TRIED = 9
# The widest accuracy there is, before it is known.
_ANY_ACCURACY = "frame PSNR 100.0 dB"


class PictureMaker:
    """A maker of the pictures of a film's frames, with their annotation, whatever moves. film: its stage."""

    def __init__(self, film: FilmStage) -> None:
        self._film, self._output = film, film.scene.output
        self._annotator = lru_cache(len(self._output.kinds))(Annotator)  # which keeps what does not change
        self._facts: tuple[FilmStage, dict[PictureKind, AnnotationFacts]] = film, {}

    def pictures(self, frame: Frame, record: FrameRecord) -> dict[int, Picture]:
        """Return the pictures of a frame by the numbers of their kinds: all that files need which show it.

        They are reduced, annotated, over their backgrounds, and rounded. record: with the accuracy if that is shown.
        """
        spec, kinds = frame.stage.scene.annotation, self._output.kinds
        radiance, found = frame.radiance_with_lines(), dict[int, Picture]()
        for number in self._output.kinds_at(frame.number):
            if number == 0 and not spec.shows_anything:
                found[0] = Picture(frame.image)
                continue
            kind = kinds[number].at(frame.number)
            image = reduce_radiance(radiance, self._output.size[0] // kind.size[0])
            if spec.entries:
                image = image.copy() if image is frame.radiance else image
                self._annotate(image, kind, frame.stage, frame.view, record)
            found[number] = Picture(quantize(image, kind.background_at(frame.number), kind.depth))
        return found

    def _annotate(self, image: Float32, kind: PictureKind, stage: Stage, view: View, record: FrameRecord) -> None:
        """Draw over a picture of a kind, float32 [h, w, 4]. stage, view: of the frame."""
        if stage is not self._facts[0]:
            self._facts = stage, {}
        known = self._facts[1]
        if kind not in known:
            known[kind] = film_facts(stage, kind)
        accuracy = "" if record.accuracy is None else f"frame PSNR {record.accuracy.psnr:.1f} dB"
        frame = frame_facts(self._film.scene, stage, view, record.frame, kind, accuracy)
        draw_annotation(image, self._annotator(stage.scene.annotation, known[kind]).patches(frame))

    def covered(self, frame: int, record: FrameRecord) -> Bools | None:
        """Return which pixels of a frame's first picture are drawn over, bool [h, w]; None where none is."""
        stage, kind = self._film.at(frame), self._output.kind.at(frame)
        view = view_of(stage, frame)
        if not stage.scene.annotation.shows_anything:
            return None
        canvas = np.zeros((*kind.shape[:2], 4), np.float32)
        if stage.scene.annotation.bounds:
            for layer in stage.layers:
                draw_lines(make_outline(layer.volume), view, canvas)
        self._annotate(canvas, kind, stage, view, record)
        return canvas[..., 3] > 0


def require_annotation(film: FilmStage, frames: Sequence[int]) -> None:
    """Raise SceneError where some of the frames cannot have their annotation, in pictures of any kind."""
    annotation = film.scene.at(0).annotation
    if not annotation.entries:
        return
    # Imported here: exact rays, which are in the same room, take a while to load.
    from renderer.accuracy import spread_evenly

    problems: list[Problem] = []
    for kind in film.scene.output.kinds:
        shown = []
        for frame in spread_evenly(frames, _MOST_TRIED, is_loop=False):
            # With the layers of the first frame: those of others take a while to make.
            scene = film.scene.at(frame)
            stage = replace(film.first, scene=scene, distance=scene.camera.distance or film.distance)
            shown.append(frame_facts(film.scene, stage, view_of(stage, frame), frame, kind, _ANY_ACCURACY))
        problems += annotation_problems(annotation, film_facts(film.first, kind.at(0)), shown)
    raise_problems(problems)


def annotation_notes(stage: FilmStage) -> Iterator[str]:
    """Yield what the user should know of a film's annotation."""
    annotation = stage.scene.at(0).annotation
    if annotation.scale_bar is not None and not _length_unit(stage):
        yield "the unit of lengths is not known: the scale bar counts voxels; volume.unit names it"
    if annotation.shows_anything and stage.scene.error.probes != 0:
        yield "the accuracy is that of the pictures without annotation"


def film_facts(stage: Stage, kind: PictureKind) -> AnnotationFacts:
    """Return what an annotation shows of a stage, on pictures of a kind whose background does not move."""
    background, volumes = kind.background_at(0), [layer.volume for layer in stage.layers]
    axes = {volume.world_axes for volume in volumes}
    return AnnotationFacts(
        size=kind.size,
        background=None if background is None else background if len(background) == 2 else (background, background),
        unit=_length_unit(stage) or "voxels",
        is_perspective=stage.scene.camera.projection == "perspective",
        world_axes=axes.pop() if len(axes) == 1 else "",
        bars=tuple(_bars(stage)),
        legend=tuple(_legend(stage)),
    )


def frame_facts(film: FilmScene, stage: Stage, view: View, frame: int, kind: PictureKind, accuracy: str) -> FrameFacts:
    """Return what an annotation shows of a frame. film: the scene with all that moves. stage, view: of the frame."""
    volume = stage.layers[0].volume
    side = (view.distance if view.projection == "perspective" else 1.0) / view.scale_px
    side *= view.size[0] / kind.size[0]
    right, up, away = ((x, y, z) for x, y, z in view.axes.tolist())
    at, time = stage.scene.layers[0].volume.time, None
    if volume.times and isinstance(at, (int, float)):
        time = float(np.interp(at, range(len(volume.times)), volume.times))
    return FrameFacts(
        frame=frame,
        seconds=frame / film.output.frames_per_second,
        time=time,
        moving=moving_numbers(moving_values(film, frame)) if film.moves else {},
        accuracy=accuracy,
        world_per_pixel=side if _length_unit(stage) else side / volume.finest_spacing,
        axes=(right, up, away),
    )


def _length_unit(stage: FilmStage) -> str:
    """Return the unit of world lengths, if all volumes have the same."""
    units = {layer.volume.length_unit for layer in stage.layers}
    return units.pop() if len(units) == 1 else ""


def _bars(stage: Stage) -> Iterator[ColorBar]:
    """Yield the colours of each transfer function over the range of its control points."""
    for number, layer in enumerate(stage.layers):
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


def _legend(stage: Stage) -> Iterator[tuple[str, tuple[float, float, float]]]:
    """Yield the names and colours of labels, and of volumes: their own, or that at their largest opacity."""
    for layer in stage.layers:
        labels = layer.spec.transfer_function.labels
        if labels is not None:
            yield from ((style.name or f"label {style.value}", style.color) for style in labels.styles)
        elif len(stage.layers) > 1:
            most_opaque = layer.transfer.colors[int(np.argmax(layer.transfer.extinctions))]
            red, green, blue = layer.spec.color or most_opaque.tolist()
            yield layer.spec.name or layer.volume.name, (red, green, blue)
