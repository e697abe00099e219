"""Make all pictures of a frame that the outputs of a film need."""

from __future__ import annotations

from renderer.film import Picture, quantize, reduce_radiance
from renderer.frame import FilmAnnotation, FilmStage, Frame


class PictureMaker:
    """A maker of the pictures of the frames of a film, with their annotation. film: the stage of the film."""

    def __init__(self, film: FilmStage) -> None:
        self._output, self._annotation = film.scene.output, FilmAnnotation(film)

    def pictures(self, frame: Frame, psnr: float | None) -> dict[int, Picture]:
        """Return the pictures of a frame for all files that show it, by the numbers of their kinds.

        A picture is reduced to its size, annotated, put over its background, and rounded, in this order.
        psnr: the measured accuracy of the frame, in decibels; None if it was not measured.
        """
        spec, kinds = frame.stage.scene.annotation, self._output.kinds
        radiance, found = frame.radiance_with_lines(), dict[int, Picture]()
        for number in self._output.kinds_at(frame.number):
            if number == 0 and not spec.shows_anything:
                found[0] = Picture(frame.image, dpi=kinds[0].dpi)
                continue
            kind = kinds[number].at(frame.number)
            image = reduce_radiance(radiance, self._output.size[0] // kind.size[0])
            if spec.has_patches:
                image = image.copy() if image is frame.radiance else image
                self._annotation.draw(image, kind, frame.stage, frame.number, psnr)
            found[number] = Picture(
                quantize(
                    image, kind.background_at(frame.number), kind.depth, is_linear=frame.stage.scene.light is not None
                ),
                dpi=kind.dpi,
            )
        return found
