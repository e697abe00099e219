"""Complete command lines in shells, by click's scripts for them."""

from __future__ import annotations

import click
from click.shell_completion import get_completion_class

# The environment variable by which a shell's script asks for the words that may come next.
COMPLETION_VARIABLE = "_HSPLAT_COMPLETE"
# The shells that have a script.
SHELLS = ("bash", "zsh", "fish")


def completion_script(command: click.Command, shell: str) -> str:
    """Return the script by which a shell completes the command lines of `hsplat`. shell: one of SHELLS."""
    found = get_completion_class(shell)
    assert found is not None, shell
    completer = found(command, {}, "hsplat", COMPLETION_VARIABLE)
    # Not `source()`, which starts bash to find its version.
    return completer.source_template % completer.source_vars()


def next_words(command: click.Command, asked: str) -> str:
    """Return the words that may come next, in the lines that the shell's script reads; no words for another shell.

    asked: the value of COMPLETION_VARIABLE, such as `bash_complete`. The command line is in further variables, which
    the script sets.
    """
    shell = asked.partition("_")[0]
    found = get_completion_class(shell) if shell in SHELLS else None
    return "" if found is None else found(command, {}, "hsplat", COMPLETION_VARIABLE).complete()
