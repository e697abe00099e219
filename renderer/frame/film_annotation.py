"""Draw the annotation of a film over its pictures, and check beforehand that all pictures have room for it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from math import ceil

import numpy as np

from renderer.annotation import (
    NUM_FRAMES,
    AnnotationFacts,
    Annotator,
    LabelPoints,
    NamedLabel,
    annotation_problems,
    draw_annotation,
    film_facts,
    find_anchors,
    frame_facts,
    label_points,
    length_unit,
    ordered_names,
)
from renderer.draw import draw_lines, make_outline
from renderer.errors import Problem
from renderer.frame.camera_framing import WIDEST_PSNR, names_of, spread, tried_frames
from renderer.frame.stage import FilmStage, Stage, view_of
from renderer.layers import Layer
from renderer.scene import AnnotationSpec, PictureKind, join_words, raise_problems
from renderer.view import View
from renderer.volume import Bools, Float32

# Names that take more than this share of the picture's width leave the object small, which a note says.
_LARGE_SHARE = 0.5
# The least height of a printed text that most journals take, in points.
_LEAST_PT = 5
# The entries that are no texts, whose size is that of a picture.
_NO_TEXTS = ("logo", "orientation")


class FilmAnnotation:
    """A painter of a film's annotation over the pictures of its frames. film: the stage of the film."""

    def __init__(self, film: FilmStage) -> None:
        self._film, self._output = film, film.scene.output
        # Annotators are kept, because each one keeps the drawings that do not change from frame to frame.
        self._annotator = lru_cache(len(self._output.kinds))(Annotator)
        self._facts: tuple[FilmStage, dict[PictureKind, AnnotationFacts]] = film, {}
        self._names, points = names_of(film.scene, film.layers)
        if self._names:
            self._names = self._ordered(self._names, points)
        # The points of the layers that were drawn last: layers change where a volume moves, or its labels do.
        self._points: tuple[Sequence[Layer], LabelPoints] = film.layers, points

    def _ordered(self, names: Sequence[NamedLabel], points: LabelPoints) -> list[NamedLabel]:
        """Return names in the order with the fewest crossings of lines in pictures of the first kind."""
        film, kind = self._film, self._output.kind
        facts = film_facts(film.first.scene, film.layers, kind.at(0), names)
        places, height = Annotator(film.first.scene.annotation, facts).name_places, kind.size[1]
        starts = {key: (place.start[0] / height, place.start[1] / height) for key, place in places.items()}
        views = [_view_before(film, frame) for frame in spread(range(film.scene.num_frames), NUM_FRAMES)]
        return ordered_names(names, starts, points, film.layers, views)

    def draw(self, image: Float32, kind: PictureKind, stage: Stage, frame: int, psnr: float | None) -> None:
        """Draw the annotation over a picture of a frame, float32 [h, w, 4].

        kind: the kind of the picture. stage: the stage of the frame. psnr: the PSNR of the frame in decibels, if it was
            measured.
        """
        if stage is not self._facts[0]:
            self._facts = stage, {}
        known = self._facts[1]
        if kind not in known:
            known[kind] = film_facts(stage.scene, stage.layers, kind, self._names)
        annotator = self._annotator(stage.scene.annotation, known[kind])
        view = view_of(stage, frame)
        facts = frame_facts(self._film.scene, stage.layers, view, frame, kind)
        if self._names:
            if stage.layers is not self._points[0]:
                self._points = stage.layers, label_points(stage.layers)
            anchors = find_anchors(self._names, self._points[1], stage.layers, view, kind.size[0])
            facts = replace(facts, anchors=anchors)
        patches = annotator.patches(facts.with_accuracy(psnr))
        draw_annotation(image, patches, is_linear=stage.scene.light is not None)

    def covered(self, frame: int, psnr: float | None) -> Bools | None:
        """Return which pixels of a frame's picture its annotation covers, bool [h, w]; None without an annotation.

        The picture has the size and background of the film's first output. psnr: the PSNR of the frame in decibels, if
        it was measured.
        """
        stage, kind = self._film.at(frame), self._output.kind.at(frame)
        if not stage.scene.annotation.shows_anything:
            return None
        canvas = np.zeros((*kind.shape[:2], 4), np.float32)
        if stage.scene.annotation.bounds:
            for layer in stage.layers:
                draw_lines(make_outline(layer.volume), view_of(stage, frame), canvas)
        self.draw(canvas, kind, stage, frame, psnr)
        return canvas[..., 3] > 0


def require_annotation(film: FilmStage, frames: Sequence[int]) -> None:
    """Raise SceneError if the annotation of a film cannot be drawn over the pictures of some of the given frames."""
    annotation = film.scene.at(0).annotation
    if not annotation.has_patches:
        return
    problems: list[Problem] = []
    names, _ = names_of(film.scene, film.layers)
    for kind in film.scene.output.kinds:
        shown = []
        for frame in tried_frames(frames):
            view = _view_before(film, frame)
            shown.append(frame_facts(film.scene, film.layers, view, frame, kind).with_accuracy(WIDEST_PSNR))
        facts = film_facts(film.first.scene, film.layers, kind.at(0), names)
        for problem in annotation_problems(annotation, facts, shown):
            files = [each.file.name for each in film.scene.output.files if each.kind == kind]
            where = f", in {join_words(files, 'and')}" if film.scene.output.others else ""
            problems.append(replace(problem, what=problem.what + where))
    raise_problems(problems)


def _view_before(film: FilmStage, frame: int) -> View:
    """Return the view of a frame before its layers are made, which takes a while: with those of the first frame."""
    scene = film.scene.at(frame)
    return view_of(replace(film.first, scene=scene, distance=scene.camera.distance or film.distance), frame)


def _print_notes(annotation: AnnotationSpec, kind: PictureKind) -> Iterator[str]:
    """Yield a note on texts that are too small in print, if the picture has a printed size."""
    texts = [key for key in annotation.entries if key not in _NO_TEXTS]
    if kind.dpi is None or not texts:
        return
    smallest, pt_of_height = min(texts, key=annotation.size_of), 72 * kind.size[1] / kind.dpi
    if (pt := annotation.size_of(smallest) * pt_of_height) < _LEAST_PT:
        key = "size" if annotation.entries[smallest].size is None else f"{smallest}.size"
        size = ceil(1000 * _LEAST_PT / pt_of_height) / 1000
        yield f"texts of {pt:.2g} pt are small in print: annotation.{key}: {size:g} makes them {_LEAST_PT} pt high"


def annotation_notes(stage: FilmStage) -> Iterator[str]:
    """Yield notes on a film's annotation that are shown to the user."""
    annotation = stage.scene.at(0).annotation
    yield from _print_notes(annotation, stage.scene.output.kind.at(0))
    names, _ = names_of(stage.scene, stage.layers)
    if names:
        facts = film_facts(stage.first.scene, stage.layers, stage.scene.output.kind.at(0), names)
        share = Annotator(annotation, facts).names_share
        if share > _LARGE_SHARE and annotation.layout == "beside":
            taken = f"names take {100 * share:.0f} % of the picture's width, and the object has the rest"
            yield f"{taken}; a wider output.size, or a smaller annotation.names.size, leaves it more room"
    if annotation.scale_bar is not None and not length_unit(stage.layers):
        yield "the unit of lengths is not known: the scale bar counts voxels; volume.unit names it"
    if annotation.shows_anything and stage.scene.error.probes != 0 and stage.scene.at(0).light is None:
        yield "the accuracy is that of the pictures without annotation"
