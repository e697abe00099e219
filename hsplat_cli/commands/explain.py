"""Run `hsplat explain KEY`: say what a key of a scene is."""

from __future__ import annotations

import click

from hsplat_cli.terminal import Reporter
from renderer.scene import explain_key, scene_keys
from renderer.system import join_lines


def _keys_that_begin(context: click.Context, parameter: click.Parameter, incomplete: str) -> list[str]:
    """Return the keys that a shell offers: of the section in the text so far, or the sections, without keys below."""
    depth = incomplete.count(".")
    return [key for key, _ in scene_keys() if key.startswith(incomplete) and key.count(".") == depth]


@click.command()
@click.argument("key", default="", shell_complete=_keys_that_begin)
def explain(key: str) -> None:
    """Say what a key of a scene is: its values, bounds and default.

    KEY is dotted, such as light.key.radius; without it, all sections of a scene are listed.
    """
    Reporter().result(join_lines(explain_key(key)))
