"""Choose the level of each store that is drawn: the coarsest one whose pictures are as exact as the scene asks.

The size of voxels on the screen does not tell: at as many voxels a pixel, a level of an engine is within 32 dB of the
finest one, a level of a smooth field within 58 dB.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from renderer.accuracy import MOST_DB, ErrorSamples, asked_psnr, psnr, squared_error
from renderer.cache import NOT_KEPT, KeptArrays, numbers_from_array, numbers_to_array
from renderer.frame import FilmStage, prepare_stage
from renderer.readers import most_level_bytes, read_part, read_volume, state_of_store
from renderer.resolve.level_errors import LevelErrors
from renderer.scene import AnyScene, LayerSpec, LevelChoice, OverFrames, Scene, VolumeSpec, first_output, scene_to_dict
from renderer.system import num_cores
from renderer.volume import Array, Volume

# A level counts as exact enough if its error is at most this share of the error that the scene asks for, so that the
# error of drawing has room beside it.
_SHARE_OF_ERROR = 0.5
# The estimated error of a level counts with this many of its standard deviations more, as in a search for tolerances.
_MARGIN = 1.5
# A level is not tried if its longest side has fewer voxels than this share of the picture's longer side.
_LEAST_SIDE = 0.25

# The name of the choices in their entry of the cache folder.
_CHOICES = "choices"
# The sections of a scene on which no choice depends. Of the output, all but the name of its file counts.
_UNSEEN = ("output", "annotation")

# The words for a level that is not larger than the memory allows.
_FITS = "fits into a quarter of the free memory"


@dataclass(frozen=True)
class _OpenStore:
    """A store whose level is to be chosen.

    key: the key of its volumes, as of `_key`. sizes: for each level, from the finest to the coarsest, the bytes of the
    voxels of a volume. sides: for each level, the number of voxels along the longest side.
    """

    key: Hashable
    sizes: Sequence[int]
    sides: Sequence[int]

    def has(self, volume: VolumeSpec) -> bool:
        """Return whether a volume is of this store."""
        return _key(volume) == self.key


def with_levels(scene: AnyScene, resolve: Callable[[AnyScene], AnyScene]) -> AnyScene:
    """Return the scene with the number of a level for each volume in a store that names none.

    All volumes of a store, such as channels, get the same level. It is measured while other stores have a coarse level.
    Volumes in other files, and in stores of one level, are left as they are.

    resolve: chooses everything else that a scene leaves open. Raises InputError for stores that cannot be read, and the
    errors of `resolve`.
    """
    volumes = [layer.volume for layer in scene.at(0).layers if layer.volume.has_open_level]
    found = map(_open_store, {_key(volume): volume for volume in volumes}.values())
    stores = [store for store in found if store is not None]
    if not stores:
        return scene
    asked, most = asked_psnr(scene.error), most_level_bytes()
    numbers = {store.key: _candidates(store, max(scene.output.size), asked, most) for store in stores}
    first = {key: _choice(store, numbers[key][0], asked, _why_alone(store, most)) for key, store in _by_key(stores)}
    if all(len(each) == 1 for each in numbers.values()):
        return _with_choices(scene, first)
    entry = _kept_choices(scene, stores, numbers, asked)
    with entry.making() as kept:
        if kept is not None:
            chosen = _kept_in(kept, stores)
        else:
            film = prepare_stage(resolve(_with_choices(scene, first)), clock=lambda: 0.0, num_threads=num_cores())
            with film:
                chosen = {
                    key: _measured_choice(store, film, numbers[key], asked) if len(numbers[key]) > 1 else first[key]
                    for key, store in _by_key(stores)
                }
            entry.keep({_CHOICES: numbers_to_array([chosen[store.key] for store in stores])})
    return _with_choices(scene, chosen)


def _kept_choices(
    scene: AnyScene, stores: Sequence[_OpenStore], numbers: Mapping[Hashable, Sequence[int]], asked: float
) -> KeptArrays:
    """Return the entry of the cache folder for the levels of a scene's stores, which depend on all that rays meet.

    Nothing is kept for a scene with volumes in files that are no stores. numbers: the levels that are tried.
    """
    layers = scene.map(lambda each: each.layers).at(0)
    masks = [layer.mask.volume for layer in layers if layer.mask is not None]
    volumes = {volume for volume in (*(layer.volume for layer in layers), *masks) if isinstance(volume, VolumeSpec)}
    states = {repr(state_of_store(replace(volume, level=0))) for volume in volumes}
    if repr(None) in states:
        return NOT_KEPT
    tree = scene_to_dict(scene)
    seen = {key: section for key, section in tree.items() if key not in _UNSEEN}
    output = {key: value for key, value in first_output(tree).items() if key != "file"}
    facts = seen, output, sorted(states), [*numbers.values()], asked
    return KeptArrays.of("choice", facts, max(store.sizes[0] for store in stores))


def _kept_in(arrays: Mapping[str, Array], stores: Sequence[_OpenStore]) -> dict[Hashable, LevelChoice]:
    """Return the choices in an entry of the cache folder, by the keys of their stores."""
    choices = numbers_from_array(arrays[_CHOICES])
    return {store.key: LevelChoice(*choice) for store, choice in zip(stores, choices, strict=True)}


def _by_key(stores: Sequence[_OpenStore]) -> list[tuple[Hashable, _OpenStore]]:
    return [(store.key, store) for store in stores]


def _key(volume: VolumeSpec) -> Hashable:
    """Return the key of a volume's store: volumes of the same image and crop have the same key."""
    return volume.source, volume.dataset, volume.crop


def _open_store(volume: VolumeSpec) -> _OpenStore | None:
    """Return the store of a volume; None for a volume in another file, and for a store of one level."""
    image = read_part(replace(volume, level=0), None)
    if image is None or image.box is None or len(image.levels) < 2:
        return None
    share = math.prod(end - begin for begin, end in image.box) / math.prod(image.levels[0].shape)
    sizes = [round(share * level.num_bytes) for level in image.levels]
    return _OpenStore(_key(volume), sizes, [max(level.shape) for level in image.levels])


def _candidates(store: _OpenStore, side: int, asked: float, most_bytes: float) -> list[int]:
    """Return the levels that are tried, from the coarsest to the finest.

    side: the longer side of the picture in pixels. asked: the PSNR that is asked for, in decibels. most_bytes: the
    largest number of bytes of a level that fits. The coarsest level always fits.
    """
    last = len(store.sizes) - 1
    finest = next((number for number, size in enumerate(store.sizes) if size <= most_bytes), last)
    if math.isinf(asked):
        return [finest]
    fine = [number for number in range(finest, last + 1) if store.sides[number] >= _LEAST_SIDE * side]
    return fine[::-1] or [finest]


def _why_alone(store: _OpenStore, most_bytes: float) -> str:
    """Return why a level is drawn if no other is tried."""
    if store.sizes[0] <= most_bytes:
        return "the finest, as coarser ones have too few voxels or tolerance 0 is asked for"
    return f"the finest that {_FITS}"


def _measured_choice(store: _OpenStore, film: FilmStage, numbers: Sequence[int], asked: float) -> LevelChoice:
    """Return the coarsest level that is exact enough, or else the last one. numbers: the levels that are tried."""
    last = numbers[-1]
    if (reason := _unmeasured(store, film)) is not None:
        return _choice(store, last, asked, f"the finest that {_FITS}, as {reason}")
    # The coarsest level that is tried is compared with the next coarser one, or with the next finer one.
    other = numbers[0] + 1 if numbers[0] + 1 < len(store.sizes) else numbers[0] - 1
    errors = LevelErrors(film, store.has, partial(_read_level, other))
    for number in numbers:
        if number == 0:
            break
        read, most = partial(_read_level, number), _SHARE_OF_ERROR * squared_error(asked)
        samples = errors.error_of(read)
        if samples.mean <= most < _with_margin(samples) and errors.use_more_rays():
            samples = errors.error_of(read)
        error = _with_margin(samples)
        is_exact = error <= most
        if is_exact or number == last:
            why = "the coarsest that is exact enough" if is_exact else f"the finest that {_FITS}"
            least = min(psnr(error), MOST_DB)
            choice = _choice(store, number, asked, why)
            return choice._replace(
                num_measured=errors.num_bytes, psnr=min(psnr(samples.mean), MOST_DB), least=least, is_exact=is_exact
            )
    return _choice(store, 0, asked, "the finest, as no coarser one is exact enough")._replace(
        num_measured=errors.num_bytes
    )


def _with_margin(samples: ErrorSamples) -> float:
    """Return an error that is larger than the true one in most cases."""
    return samples.mean + _MARGIN * samples.deviation


def _unmeasured(store: _OpenStore, film: FilmStage) -> str | None:
    """Return why the levels of a store are not measured; None if they are."""
    for layer in film.layers:
        if not store.has(layer.spec.volume):
            continue
        if layer.volume.colors is not None:
            return "levels of colours are not measured"
        if layer.volume.num_absent:
            return "levels with voxels without data are not measured"
        if layer.volume.is_labels and store.sizes[0] > most_level_bytes():
            return "levels of labels are measured only where the finest fits into memory"
    return None


def _read_level(number: int, volume: VolumeSpec) -> Volume:
    return read_volume(replace(volume, level=number))


def _choice(store: _OpenStore, number: int, asked: float, why: str) -> LevelChoice:
    """Return the choice of a level that is not measured."""
    return LevelChoice(number, len(store.sizes), why, store.sizes[number], 0, asked)


def _with_choices(scene: AnyScene, chosen: Mapping[Hashable, LevelChoice]) -> AnyScene:
    """Return the scene with the levels that were chosen, by the keys of their stores."""

    def with_level(layer: LayerSpec) -> LayerSpec:
        choice = chosen.get(_key(OverFrames(layer.volume).at(0))) if layer.volume.level is None else None
        if choice is None:
            return layer
        return replace(layer, volume=replace(layer.volume, level=choice.number, chosen=choice))

    def edit(sections: Scene) -> Scene:
        return replace(sections, layers=tuple(map(with_level, sections.layers)))

    return scene.changed(edit)
