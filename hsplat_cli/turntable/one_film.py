"""Write the scene of one volume beside its film, and render that scene as `hsplat render` does."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from contextlib import nullcontext, suppress
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

from hsplat_cli.scenes import SCHEMA_FILE, SCHEMA_LINE, suggest_scene, volume_place, write_schema
from hsplat_cli.terminal import FilmEvents, Reporter, report_film
from hsplat_cli.turntable import manifest
from hsplat_cli.turntable.film_request import FilmRequest
from hsplat_cli.turntable.manifest import FilmEntry, update_manifest
from renderer.errors import HsplatError, InputError
from renderer.film import (
    bytes_digest,
    require_writable,
    translate_os_errors,
    write_staged,
)
from renderer.job import FilmJob, expand_pattern
from renderer.record import file_states
from renderer.scene import (
    ColormapSpec,
    FilmScene,
    LabelsSpec,
    accuracy_of,
    is_url,
    join_some,
    parse_scene_content,
)

if TYPE_CHECKING:
    from renderer.suggest import Suggestion


def make_film(request: FilmRequest, reporter: Reporter) -> FilmEntry:
    """Make the film, add its entry to turntable.json, and return the entry. Raises HsplatError.

    A film that fails also gets an entry, unless its folder did not exist before and is still empty: such a folder is
    removed again.
    """
    folder = request.scene.parent
    missing_folders = [each for each in (folder, *folder.parents) if not os.path.exists(each)]
    try:
        record = _make_film(request, reporter)
    except (HsplatError, KeyboardInterrupt) as error:
        failure = request.failure(error) if isinstance(error, HsplatError) else request.entry(manifest.INTERRUPTED)
        for each in missing_folders:
            with suppress(OSError):  # not empty
                each.rmdir()
        if os.path.isdir(folder):
            manifest.try_to_update(folder, [failure], reporter)
        raise
    update_manifest(folder, [record], reporter)
    return record


def _make_film(request: FilmRequest, reporter: Reporter) -> FilmEntry:
    """Write the scene, render it, and return the film's entry for turntable.json. Raises HsplatError."""
    if request.problem is not None:
        raise request.problem
    if isinstance(place := volume_place(request.volume), Path):
        expand_pattern(str(place))  # raises where no file matches
    inputs = file_states(request.input_files())
    # Checked before the volume is read, which may take long.
    require_writable(request.scene)
    text, facts, notes = _scene_text(request, reporter)
    content = marked_scene(text, request.volume_path)
    _require_replaceable(request, content)
    # Imported here to keep --help fast.
    from hsplat_cli.executors import open_executor
    from renderer.readers import read_volume
    from renderer.resolve import resolve_scene

    with request.look.located() if request.look else nullcontext():
        # Parsed before the file exists, so that no change to the file affects the job.
        scene = parse_scene_content(content, request.scene)
        scene = resolve_scene(scene, read_volume)  # which chooses steps in time, and values of percentiles
    from renderer.job import make_film as draw_film, one_pass
    from renderer.record import round_decibels, round_seconds, visibility_text

    job = FilmJob(scene, range(scene.num_frames), accuracy_of(scene.error))
    open_this = partial(open_executor, request.executor, reporter, num_processes=request.num_processes)
    with _TurntableEvents(reporter, request, content, scene.primitive_name) as events:
        result = draw_film(job, open_this, one_pass, events, resumes=not request.force)
    report_film(result, reporter)
    if result.shortfall is not None:
        raise result.shortfall
    made = result.film.record
    accuracy, visibility = made.accuracy, made.visibility
    seen = ", ".join(each.word for each in result.glances if each.word)
    if not result.summary:  # the film was up to date, and was not examined again
        before = manifest.read_films(request.scene.parent).get(request.scene.name)
        seen = (before.seen if before else None) or ""
    return replace(
        facts,
        # Without a fingerprint of the film, the next job makes the film again.
        made_by=None if made.fingerprint is None else request.fingerprint(inputs).digest,
        psnr=None if accuracy is None else round_decibels(accuracy.psnr),
        psnr_interval=None if accuracy is None else accuracy.interval,
        file_psnr=None if accuracy is None else round_decibels((accuracy.file or accuracy).psnr),
        seen=seen or None,
        values=_visible_values(scene) if facts.values is None else facts.values,
        hidden="" if visibility is None else visibility_text(visibility),
        notes=(*made.notes, *notes),
        frames=len(made.frames),
        primitives=round(sum(frame.primitives for frame in made.frames) / len(made.frames)),
        seconds=round_seconds(made.seconds["total"]),
    )


def _scene_text(request: FilmRequest, reporter: Reporter) -> tuple[str, FilmEntry, Sequence[str]]:
    """Return the scene's text, the film's entry with facts about the scene, and notes. Raises HsplatError."""
    entry = request.entry(manifest.FINISHED)
    if request.look is not None:
        text, notes = request.look.scene_text(request.volume, request.scene, reporter)
        return text, replace(entry, kind=request.look.path.name, reason=""), notes
    text, found = suggest_scene(request.volume, request.film, reporter, scene=request.scene, output=request.output)
    chosen = found.suggestion
    facts = replace(entry, kind=chosen.kind, reason=chosen.reason, values=_shown_values(chosen))
    return text, facts, chosen.outlier_notes


def _visible_values(scene: FilmScene) -> str:
    """Return the range of the visible values of the first volume, such as `18.9 to 255`, or its labels' names."""
    transfer = scene.at(0).layers[0].transfer_function
    if transfer.labels is not None:
        return _label_names(transfer.labels)
    pairs = [(point.value, point.opacity) for point in transfer.points]
    if isinstance(transfer.mapping, ColormapSpec):
        pairs = [*transfer.mapping.opacity]
    ends = [value for pair in pairwise(pairs) if pair[0][1] or pair[1][1] for value, _ in pair]
    return f"{min(ends):g} to {max(ends):g}" if ends else ""


def _shown_values(suggestion: Suggestion) -> str:
    """Return the range of the values that a suggested scene shows, such as `18.9 to 255`, or the names of its labels.

    Returns an empty text where it is not known which values are shown.
    """
    if (labels := suggestion.transfer.labels) is not None:
        return _label_names(labels)
    ends = [end for layer in suggestion.visible for each in layer.ranges for end in each]
    return f"{min(ends):g} to {max(ends):g}" if ends else ""


def _label_names(labels: LabelsSpec) -> str:
    """Return the names of labels, as `caudate, putamen and 14 more`; a label without a name has its number."""
    return join_some([style.name or f"label {style.value}" for style in labels.styles])


class _TurntableEvents(FilmEvents):
    """A listener of a film job that prints, writes the scene's file, and records the start in turntable.json."""

    def __init__(self, reporter: Reporter, request: FilmRequest, content: bytes, noun: str) -> None:
        super().__init__(reporter, noun)
        self._request, self._content = request, content

    def locked(self) -> None:
        """Write the scene's file, now that no other job can change it before the film is finished."""
        write_scene(self._request, self._content, self._reporter)

    def volume_noted(self, text: str) -> None:
        """Print a note on the volume, unless it was printed when the scene was suggested."""
        if self._request.look is not None:
            super().volume_noted(text)

    def prepared(self) -> None:
        """Record in turntable.json that the film is started; a film that is up to date is never prepared."""
        update_manifest(self._request.scene.parent, [self._request.entry(manifest.STARTED)], self._reporter)


def write_scene(request: FilmRequest, content: bytes, reporter: Reporter) -> None:
    """Write the scene's file, and record that its film is started, unless the file has this content.

    Raises InputError where the file is an edited scene, or the scene of another volume, unless with `force`.
    """
    if not _require_replaceable(request, content):
        update_manifest(request.scene.parent, [request.entry(manifest.STARTED)], reporter)
        write_schema(request.scene.with_name(SCHEMA_FILE))
        write_staged(request.scene, content)


def _require_replaceable(request: FilmRequest, content: bytes) -> bool:
    """Return whether the scene's file already has `content`. Raises InputError if the file must not be replaced."""
    scene = request.scene
    with translate_os_errors(scene):
        existing = scene.read_bytes() if scene.exists() else None
    if existing is None or existing == content or request.force:
        return existing == content
    volume = _volume_of_unedited(existing)
    if volume is None:
        raise InputError(
            "another scene of this name exists, perhaps one that was edited",
            where=str(scene),
            hint=f"`hsplat render {scene}` renders it; --force overwrites it",
        )
    if volume != request.volume_path:
        place = os.path.join(os.path.realpath(scene.parent), volume)
        raise InputError(
            "a film of another volume has this name",
            where=str(scene),
            got=f"the scene of {volume if is_url(volume) else os.path.relpath(place)}",
            hint="give this one another --output, or both to one command, which gives them different names; "
            "--force overwrites it",
        )
    return False


# The text before a volume's path in the last line of a scene by `marked_scene`; its quote begins the path, in JSON.
_MARK = b'; of "'


def marked_scene(text: str, volume_path: str) -> bytes:
    """Return a scene with a last line that names its volume, and has a digest, which shows whether it was edited.

    So a scene that may be replaced is known without turntable.json, also after it was moved with its volume.
    """
    volume = json.dumps(volume_path)
    marked = f"{SCHEMA_LINE}{text}\n# `hsplat turntable` replaces this file while nobody has changed it; of {volume}: "
    return f"{marked}{bytes_digest(marked.encode())}\n".encode()


def _volume_of_unedited(content: bytes) -> str | None:
    """Return the volume's path in a scene by `marked_scene`; None for an edited scene, or one without a mark."""
    before, mark, digest = content.rpartition(b": ")
    is_unedited = bytes_digest(before + mark).encode() + b"\n" == digest
    return json.loads(before[before.rindex(_MARK) + len(_MARK) - 1 :]) if is_unedited and _MARK in before else None
