"""Runs the command `hsplat`: finds the subcommand, and turns errors into messages and exit codes (nothing else does).

Exit codes: 0 for success, 1 for a failed render or a bug, 2 for wrong input, and 128 plus the number of a signal for an
interruption by it (130 for Ctrl-C). `compare` and `verify` exit with 1 where something differs, and with 2 where they
could not compare.
"""

from __future__ import annotations

import contextlib
import errno
import importlib
import io
import os
import select
import sys
import traceback
from collections.abc import Sequence
from typing import TextIO

import click
from click.shell_completion import CompletionItem

from hsplat_cli.terminal import COMPLETION_VARIABLE, Reporter, next_words, set_hint
from renderer.errors import HsplatError, InputError, closest_match, format_message
from renderer.system import address_space_hint, exit_on_signals, interrupted_status, join_lines, signals_as_interrupts

# The summary of each command. The command is the function NAME in `hsplat_cli/commands/NAME.py`, which is imported only
# when it is called, so that `hsplat --help` is fast.
COMMANDS = {
    "render": "Render a scene to a film or to numbered frames.",
    "assemble": "Make one film of frames that were drawn in parts.",
    "verify": "Verify a film by its sidecar; exit with 1 where it differs.",
    "cite": "Print how a film was made, for a paper, and BibTeX.",
    "check": "Check a scene file and list everything that is wrong with it.",
    "init": "Write a scene file for a volume, to start from.",
    "preview": "Show a scene or a volume on one page, before its film is made.",
    "turntable": "Render turntables of volumes without a scene file.",
    "measure": "Measure the cost and the accuracy of a scene.",
    "golden": "Keep frames of scenes to compare later ones with.",
    "compare": "Compare frames with golden ones; exit with 1 where they differ.",
    "info": "Describe a volume: shape, place, values and histogram.",
    "explain": "Say what a key of a scene is: its values, bounds and default.",
    "schema": "Print the JSON Schema of scenes, for editors.",
    "doctor": "Say what is installed, what draws, and what is missing.",
    "completion": "Print the script by which bash, zsh or fish completes commands.",
    "man": "Print the manual page of hsplat and all of its commands.",
}

# The class of the error that click 8.2 and newer raise for a command line without arguments; no class in older ones.
_NO_ARGUMENTS_ERROR: type[click.UsageError] | tuple[()] = getattr(click.exceptions, "NoArgsIsHelpError", ())
# Parts of the messages by which the dynamic linker and Python's threads report that memory has run out.
_OUT_OF_MEMORY_TEXTS = ("failed to map segment", "annot allocate memory", "can't start new thread")


class LazyGroup(click.Group):
    """Lists the commands without importing them, and imports a command when it is called."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            if ctx.resilient_parsing:  # a shell completes a command line that is not whole
                return None
            close = closest_match(cmd_name, COMMANDS)
            raise InputError(
                f"hsplat has no command {cmd_name!r}",
                expected=", ".join(COMMANDS),
                hint=f"did you mean {close}?" if close else None,
            )
        command = getattr(importlib.import_module(f"hsplat_cli.commands.{cmd_name}"), cmd_name)
        assert isinstance(command, click.Command), cmd_name
        return command

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        commands = [(name, summary) for name, summary in COMMANDS.items() if name.startswith(incomplete)]
        options = click.Command.shell_complete(self, ctx, incomplete)
        return [*(CompletionItem(name, help=summary) for name, summary in commands), *options]

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl(list(COMMANDS.items()))


@click.command(
    cls=LazyGroup,
    invoke_without_command=True,
    no_args_is_help=True,
    subcommand_metavar="COMMAND [ARGS]...",
    context_settings={"help_option_names": ["-h", "--help"]},
)
@click.option("--version", "shows_version", is_flag=True, help="Show the version.")
@click.option("--verbose", "is_verbose", is_flag=True, help="With --version: show the kernels and libraries, too.")
@click.pass_context
def hsplat(context: click.Context, shows_version: bool, is_verbose: bool) -> None:
    """Turn scalar volumes into film loops by hierarchical splatting."""
    if shows_version:
        Reporter().result(_version_text(is_verbose=is_verbose))
        context.exit()
    if context.invoked_subcommand is None or is_verbose:
        raise click.UsageError("--verbose belongs to --version." if is_verbose else "Missing command.")


def _version_text(*, is_verbose: bool) -> str:
    """Return the version of hsplat; with is_verbose, also a line for each program that pictures depend on."""
    from renderer.system import package_versions

    versions = package_versions()
    if is_verbose:
        from renderer.kernels import describe_kernels

        versions = {"hsplat": versions["hsplat"], "kernels": describe_kernels()} | versions
    return join_lines(f"{name} {version}" for name, version in versions.items() if is_verbose or name == "hsplat")


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command line, by default the arguments of the process, and exit."""
    _replace_closed_streams()
    for stream in (sys.stdout, sys.stderr):  # a file name may have characters that the terminal's encoding lacks
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    code = run(sys.argv[1:] if arguments is None else arguments)
    exit_on_signals(code)
    for stream in (sys.stdout, sys.stderr):
        _flush_or_discard(stream)
    sys.exit(code)


def run(arguments: Sequence[str]) -> int:
    """Run a command line and return the exit code; print errors on the standard error stream."""
    failed = 2 if list(arguments[:1]) in (["compare"], ["verify"]) else 1
    try:
        if COMPLETION_VARIABLE in os.environ:
            Reporter().content(next_words(hsplat, os.environ[COMPLETION_VARIABLE]).encode() + b"\n")
            return 0
        return _invoke(arguments)
    except HsplatError as error:
        _print_error(str(error))
        return 2 if isinstance(error, InputError) else failed
    except (KeyboardInterrupt, click.Abort) as error:
        _print_error("hsplat: interrupted")
        return interrupted_status(error)
    except Exception as error:  # the last resort: no traceback reaches a user
        if _is_out_of_memory(error):
            _print_error(format_message("hsplat: out of memory", hint=address_space_hint()))
        elif isinstance(error, OSError) and error.errno in (errno.ENOSPC, errno.EDQUOT) and error.filename is None:
            _print_error(f"hsplat: the output cannot be printed: {error.strerror}")
        elif not (isinstance(error, BrokenPipeError) and _is_stdout_broken()):
            text = f"{type(error).__name__}: {error}"
            _print_error(f"hsplat: unexpected {text} (a bug; please report it, HSPLAT_DEBUG=1 shows the traceback)")
        return failed


def _invoke(arguments: Sequence[str]) -> int:
    # click's own main() is not used: it handles every EOFError as an interrupt, and every broken pipe as one of stdout.
    code = 0
    try:
        with signals_as_interrupts(), hsplat.make_context("hsplat", list(arguments)) as context:
            hsplat.invoke(context)
    except click.exceptions.Exit as done:
        code = done.exit_code
    except click.ClickException as error:
        _print_usage_error(error)
        code = error.exit_code
    sys.stdout.flush()
    return code


def _print_usage_error(error: click.ClickException) -> None:
    """Print an error of click in click's own layout, with the arguments that it quotes made printable."""
    lines = [f"Error: {error.format_message()}"]
    if isinstance(error, _NO_ARGUMENTS_ERROR):  # the message of this error is the help
        lines = error.format_message().splitlines()
    elif isinstance(error, click.UsageError) and error.ctx is not None:
        usage, help_hint = error.ctx.get_usage(), f"Try '{error.ctx.command_path} --help' for help."
        if isinstance(error, click.NoSuchOption) and (hint := set_hint(error.ctx.command, error.option_name)):
            lines = [f"Error: {error.message}", f"  hint: {hint}"]
        lines = [*usage.splitlines(), help_hint, "", *lines]
    Reporter().warning(join_lines(lines))


def _replace_closed_streams() -> None:
    """Open standard streams that are closed, as by `>&-`, so that no file opened later gets their descriptors."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115  for the whole run


def _flush_or_discard(stream: TextIO) -> None:
    """Flush a stream for the last time; a failure of Python's own flush at the exit would make the exit code 120."""
    try:
        stream.flush()
    except OSError:  # the disk is full, or nobody reads the stream: send the rest of its buffer to the null device
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def _print_error(text: str) -> None:
    with contextlib.suppress(OSError):  # nobody reads the stream, or the disk is full
        Reporter().warning(text)
        if os.environ.get("HSPLAT_DEBUG") == "1":
            Reporter().warning(join_lines(traceback.format_exc().splitlines()))


def _is_out_of_memory(error: BaseException) -> bool:
    """Return whether memory or address space ran out, also where a library or a thread reports another error for it."""
    chain: list[BaseException] = []
    while error not in chain:
        chain.append(error)
        error = error.__cause__ or error.__context__ or error
    return any(
        isinstance(one, MemoryError)
        or (isinstance(one, OSError) and one.errno == errno.ENOMEM)
        or (
            isinstance(one, (OSError, ImportError, RuntimeError))
            and any(text in str(one) for text in _OUT_OF_MEMORY_TEXTS)
        )
        for one in chain
    )


def _is_stdout_broken() -> bool:
    """Return whether nobody reads the standard output any more, as in `hsplat ... | head`."""
    poll = select.poll()
    try:
        poll.register(sys.stdout.fileno(), 0)
    except OSError:  # not a file
        return False
    return any(event & select.POLLERR for _, event in poll.poll(0))
