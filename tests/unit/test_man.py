"""The manual page has all commands and options, as roff that no text can disturb."""

from __future__ import annotations

import re

import click
import pytest

from hsplat_cli import main
from hsplat_cli.commands.man import RoffFormatter


def test_the_page_has_all_commands_and_their_options(capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["man"]) == 0
    page = capsys.readouterr().out
    assert page.isascii()
    lines = page.splitlines()
    assert {line.split()[0] for line in lines if line.startswith((".", "'"))} == {".TH", ".SH", ".SS", ".PP", ".TP"}
    headings = ["NAME", "SYNOPSIS", "DESCRIPTION", "OPTIONS", "COMMANDS", "EXIT STATUS", "ENVIRONMENT"]
    assert [line[4:] for line in lines if line.startswith(".SH ")] == headings
    text = page.replace("\\-", "-")
    context = click.Context(main.hsplat, info_name="hsplat")
    for name in main.COMMANDS:
        command = main.hsplat.get_command(context, name)
        assert command is not None
        (own,) = re.findall(rf"(?s)\n\.SS \"hsplat {name} (.*?)(?=\n\.S[SH]|$)", text)
        for option in (each for each in command.params if isinstance(each, click.Option) and not each.hidden):
            assert all(word in own for word in option.opts), (name, option.opts)


def test_text_is_no_request() -> None:
    page = RoffFormatter()
    page.write_text(".so /etc/passwd\n\n'tis a \\fB back-slash\n\nÅ")
    assert page.lines == [
        ".SH DESCRIPTION",
        "\\&.so /etc/passwd",
        *(".PP", "\\&\\(aqtis a \\efB back\\-slash"),
        *(".PP", "\\[u00C5]"),
    ]
