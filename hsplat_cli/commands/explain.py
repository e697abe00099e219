"""Run `hsplat explain KEY`: say what a key of a scene is."""

from __future__ import annotations

import click

from hsplat_cli.terminal import Reporter
from renderer.scene import explain_key
from renderer.system import join_lines


@click.command()
@click.argument("key", default="")
def explain(key: str) -> None:
    """Say what a key of a scene is: its values, bounds and default.

    KEY is dotted, such as light.key.radius; without it, all sections of a scene are listed.
    """
    Reporter().result(join_lines(explain_key(key)))
