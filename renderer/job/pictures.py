"""Make the pictures of a frame that the outputs of a film need: reduced, annotated, over backgrounds, and rounded."""

from __future__ import annotations

from renderer.film import Picture, quantize, reduce_radiance
from renderer.frame import Frame
from renderer.job.annotation import FilmAnnotation
from renderer.job.record import FrameRecord
from renderer.scene import PictureKind, values_at


def make_pictures(frame: Frame, record: FrameRecord, annotation: FilmAnnotation) -> dict[int, Picture]:
    """Return the pictures of a frame by the numbers of their kinds: all that files need which show it.

    record: of the frame, with its accuracy if that is shown.
    """
    spec, output = frame.stage.scene.annotation, annotation.film.scene.output
    radiance, found = frame.radiance_with_lines(), dict[int, Picture]()
    for number in output.kinds_at(frame.number):
        if number == 0 and not spec.shows_anything:
            found[0] = Picture(frame.image)
            continue
        kind = PictureKind(*values_at(output.kinds[number], frame.number))
        image = reduce_radiance(radiance, output.size[0] // kind.size[0])
        if spec.entries:
            image = image.copy() if image is frame.radiance else image
            annotation.draw(image, kind, frame.stage, record)
        found[number] = Picture(quantize(image, kind.background, kind.depth))
    return found
