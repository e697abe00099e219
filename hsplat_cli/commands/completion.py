"""Run `hsplat completion SHELL`: print the script by which a shell completes command lines."""

from __future__ import annotations

import click

from hsplat_cli.terminal import SHELLS, Reporter, completion_script


@click.command()
@click.argument("shell", type=click.Choice(SHELLS))
def completion(shell: str) -> None:
    """Print the script by which bash, zsh or fish completes commands.

    The shell then completes commands, options, formats and names of files. Add a line to the shell's own file; the
    next shell that starts has it. In ~/.bashrc, for bash 4.4 or newer: eval "$(hsplat completion bash)". In ~/.zshrc,
    after compinit: eval "$(hsplat completion zsh)". In ~/.config/fish/config.fish: hsplat completion fish | source.
    """
    script = completion_script(click.get_current_context().find_root().command, shell)
    Reporter().content(script.encode())
