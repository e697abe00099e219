"""Make the pictures of a frame that the outputs of a film need: reduced, over their backgrounds, and rounded."""

from __future__ import annotations

from renderer.film import Picture, quantize, reduce_radiance
from renderer.frame import Frame, Stage


class PictureMaker:
    """A maker of the pictures of a film's frames. film: its stage."""

    def __init__(self, film: Stage) -> None:
        self._output = film.scene.output
        self._kinds = self._output.kinds

    def pictures(self, frame: Frame) -> dict[int, Picture]:
        """Return the pictures of a frame by the numbers of their kinds: all that files need which show it."""
        now = frame.stage.scene.output.files
        kinds = {self._kinds.index(film.kind): file.kind for film, file in zip(self._output.files, now, strict=True)}
        found = {0: Picture(frame.image)}
        for number in self._output.kinds_at(frame.number):
            kind = kinds[number]
            if number:
                image = reduce_radiance(frame.radiance, self._output.size[0] // kind.size[0])
                found[number] = Picture(quantize(image, kind.background, kind.depth))
        return found
