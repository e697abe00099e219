"""The commands for mkdocs-click, which makes a table of the options of each on the page `options.md` of the site.

The plugin shows the name of an option's type, the stored default, and the help as Markdown. The commands here have the
placeholder as the type's name, such as KEY=VALUE, the default that `--help` states, and plain help.
"""

from __future__ import annotations

import copy
import re

import click

from hsplat_cli.main import hsplat

# Code between backticks, or a character with a meaning in Markdown.
_MARKS = re.compile(r"`[^`]*`|[\\*_{}\[\]<>#|~]")


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
    option.help = _plain(f"{option.help or ''}{' [required]' * option.required}")
    option.required = False
    # Without `show_default`, the help says the default where it matters.
    option.default = option.default if option.show_default else None
    if option.is_flag:
        option.type = _Placeholder("flag")
    elif option.metavar:
        option.type = _Placeholder(_plain(option.metavar))
    return option


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
