"""Make the pictures of a frame that the outputs of a film need: reduced, annotated, over backgrounds, and rounded."""

from __future__ import annotations

from renderer.film import Picture, quantize, reduce_radiance
from renderer.frame import Frame, Stage
from renderer.job.annotation import FilmAnnotation
from renderer.job.record import FrameRecord


class PictureMaker:
    """A maker of the pictures of a film's frames. film: its stage."""

    def __init__(self, film: Stage) -> None:
        self._output, self._kinds = film.scene.output, film.scene.output.kinds
        self._annotation = FilmAnnotation(film)

    def pictures(self, frame: Frame, record: FrameRecord) -> dict[int, Picture]:
        """Return the pictures of a frame by the numbers of their kinds: all that files need which show it.

        record: of the frame, with its accuracy if that is shown.
        """
        scene = frame.stage.scene
        now = scene.output.files
        kinds = {self._kinds.index(film.kind): file.kind for film, file in zip(self._output.files, now, strict=True)}
        is_plain, radiance, found = not scene.annotation.shows_anything, frame.radiance_with_lines(), {}
        for number in self._output.kinds_at(frame.number):
            kind = kinds[number]
            if is_plain and number == 0:
                found[0] = Picture(frame.image)
                continue
            image = reduce_radiance(radiance, self._output.size[0] // kind.size[0])
            if scene.annotation.entries:
                image = image.copy() if image is frame.radiance else image
                self._annotation.draw(image, number, kind, frame.stage, record)
            found[number] = Picture(quantize(image, kind.background, kind.depth))
        return found
