"""Declares the options that several commands share."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial, wraps
from pathlib import Path

import click
from click.core import ParameterSource

from hsplat_cli.scenes import SceneRequest
from hsplat_cli.terminal import Reporter, VolumePath, option_group, set_hint
from renderer import cache
from renderer.errors import InputError

# What the help of `--frames` says on its values.
FRAMES_WORDS = "30:41 for frames 30 to 40, as B is left out; also ::10, 7, -1."
# The click type of an argument that names a file to read. click does not check that the file exists, because its
# messages differ from hsplat's.
FILE = click.Path(path_type=Path, readable=False)
_SCENE = click.argument("scene", type=FILE)


def _use_cache(context: click.Context, _parameter: click.Parameter, folder: Path | None) -> None:
    """Let the process keep what it makes of volumes in a folder, until the command ends."""

    def tell(text: str) -> None:
        (context.params.get("reporter") or Reporter()).status(text)

    if folder is not None and not context.resilient_parsing:  # a shell that completes an option makes no folder
        context.with_resource(cache.caching_in(folder, tell))


cache_option = click.option(
    "--cache",
    type=FILE,
    metavar="FOLDER",
    expose_value=False,
    callback=_use_cache,
    help="Keep what was read and made of large volumes here, for the next command.",
)


def _make_reporter(_context: click.Context, _parameter: click.Parameter, is_quiet: bool) -> Reporter:
    return Reporter(is_quiet)


quiet_option = partial(
    click.option, "--quiet", "reporter", is_flag=True, callback=_make_reporter, help="Print only errors."
)


def takes_scene(
    frames_help: str,
    *,
    set_help: str = "Change a value: --set error.tolerance=0.2",
    volume_help: str = "Take the volume from this file.",
    arguments: Callable[[Callable[..., None]], Callable[..., None]] = _SCENE,
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Return a decorator that declares a scene and its options, and hands them to the command as one SceneRequest.

    arguments: declares the argument `scene`, and other arguments of the command.
    """
    options = option_group(
        arguments,
        click.option("--set", "overrides", multiple=True, metavar="KEY=VALUE", help=set_help),
        click.option("--frames", metavar="A:B:STEP", help=frames_help),
        click.option("--volume", type=VolumePath(), metavar="FILE", help=volume_help),
        cache_option,
    )

    def declare(command: Callable[..., None]) -> Callable[..., None]:
        @wraps(command)
        def with_request(
            *, scene: Path, overrides: tuple[str, ...], frames: str | None, volume: Path | str | None, **others: object
        ) -> None:
            command(SceneRequest(scene, overrides, volume, frames), **others)

        return options(with_request)

    return declare


def require_none_of(options: Iterable[str], hint: str) -> None:
    """Raise InputError where one of these options is given; they are for a volume without a scene.

    hint: what to do instead, for an option without a `set_hint`.
    """
    context = click.get_current_context()
    for name in options:
        if context.get_parameter_source(name) is ParameterSource.COMMANDLINE:
            option = next(each for each in context.command.params if each.name == name).opts[0]
            hint = set_hint(context.command, option) or hint
            raise InputError("this is for a volume without a scene", where=option, hint=hint)
