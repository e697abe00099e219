"""Run `hsplat schema`: print the JSON Schema of scenes, for editors."""

from __future__ import annotations

from pathlib import Path

import click

from hsplat_cli.scenes import schema_content, write_schema
from hsplat_cli.terminal import OutputPath, Reporter


@click.command()
@click.option(
    "--output", type=OutputPath(dir_okay=False), metavar="FILE", help="Write to this file, not to the standard output."
)
def schema(output: Path | None) -> None:
    """Print the JSON Schema of scenes, for editors.

    With it, they complete keys and mark mistakes. The first line of a scene names it:
    # yaml-language-server: $schema=hsplat.schema.json
    """
    reporter = Reporter()
    if output is None:
        reporter.content(schema_content())
        return
    write_schema(output)
    reporter.status(f"{output}: written; a scene beside it begins with # yaml-language-server: $schema={output.name}")
