"""The commands for mkdocs-click, which makes a table of the options of each on the page `options.md` of the site.

The plugin shows the name of an option's type, the stored default, and the help as Markdown. The commands here have the
placeholder as the type's name, such as KEY=VALUE, or the values that are allowed; the default that `--help` states, in
its help or behind it; and plain help.
"""

from __future__ import annotations

import copy
import re

import click

from hsplat_cli.main import hsplat

# Code between backticks, or a character with a meaning in Markdown.
_MARKS = re.compile(r"`[^`]*`|[\\*_{}\[\]<>#|~]")
# The default at the end of a help.
_STATED_DEFAULT = re.compile(r"\s*\[default: (.*)\]$")


class _Placeholder(click.ParamType):
    """A type that is shown by the placeholder of an option's value."""

    def __init__(self, name: str) -> None:
        self.name = name


def _plain(text: str) -> str:
    """Return a text in which no character has a meaning in Markdown, except for code between backticks."""
    return _MARKS.sub(lambda mark: mark[0] if mark[0][0] == "`" else f"&#{ord(mark[0])};", text)


def _shown(parameter: click.Parameter) -> click.Parameter:
    """Return a parameter as the page shows it; an argument stays as it is."""
    if not isinstance(parameter, click.Option):
        return parameter
    option = copy.copy(parameter)
    text = f"{option.help or ''}{' [required]' * option.required}"
    stated = _STATED_DEFAULT.search(text)
    option.help = _plain(_STATED_DEFAULT.sub("", text))
    option.required = False
    # Where there is neither `show_default` nor a default in brackets, the help says it in words, if it matters.
    option.default = option.default if option.show_default else stated and stated[1]
    option.type = _Placeholder(_plain(_values_of(option)))
    return option


def _values_of(option: click.Option) -> str:
    """Return the placeholder of an option's value, its choices, or its bounds."""
    if option.is_flag:
        return "flag"
    if option.metavar:
        return option.metavar
    if isinstance(option.type, click.Choice):
        return " | ".join(map(str, option.type.choices))
    if isinstance(option.type, (click.IntRange, click.FloatRange)):
        low, high = option.type.min, option.type.max
        bounds = f"from {low}" if high is None else f"{low} to {high}" if low is not None else f"to {high}"
        return f"{option.type.name.removesuffix(' range')} {bounds}"
    return option.type.name


def _documented(command: click.Command) -> click.Command:
    """Return a command as the page shows it."""
    made = copy.copy(command)
    made.params = [_shown(each) for each in command.params]
    made.help = _plain(command.help or "")
    made.add_help_option = False  # it would be a line of every table
    return made


def _documented_group() -> click.Group:
    """Return the group `hsplat` with all of its commands, as the page shows them."""
    context = click.Context(hsplat)
    found = {name: hsplat.get_command(context, name) for name in hsplat.list_commands(context)}
    commands = {name: _documented(command) for name, command in found.items() if command is not None}
    group = click.Group("hsplat", commands, help=hsplat.help, subcommand_metavar=hsplat.subcommand_metavar)
    group.params, group.add_help_option = [_shown(each) for each in hsplat.params], False
    return group


hsplat_on_page = _documented_group()
