"""Shells complete hsplat's command lines, and nothing is made or printed beside the words."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from commands import environment

from hsplat_cli import main


@pytest.mark.parametrize(
    ("shell", "line", "first", "missing"),
    [
        ("bash", "hsplat tur", ["plain,turntable"], "render"),
        ("bash", "hsplat ", ["plain,render"], "--help"),
        ("bash", "hsplat render --forc", ["plain,--force"], "render"),
        ("bash", "hsplat render ", ["file,"], "plain"),
        ("bash", "hsplat render scene.yaml --cache new/folder --forc", ["plain,--force"], "file"),
        ("bash", "hsplat turntable ~/no --output=~ --format a", ["plain,apng", "plain,avif"], "mp4"),
        ("bash", "hsplat chekc x", [""], "plain"),
        ("bash", "hsplat completion ", ["plain,bash", "plain,zsh", "plain,fish"], "powershell"),
        ("bash", "hsplat init scan.nrrd --light o", ["plain,outdoor", "plain,overcast"], "studio"),
        ("bash", "hsplat init scan.nrrd --nodata ", ["plain,auto", "plain,none"], "NUMBER"),
        ("bash", "hsplat init scan.nrrd --preset v", ["plain,vessels"], "bone"),
        ("bash", "hsplat explain li", ["plain,light"], "light.key"),
        ("bash", "hsplat explain light.key.r", ["plain,light.key.radius"], "strength"),
        ("zsh", "hsplat cit", ["plain", "cite", main.COMMANDS["cite"]], "check"),
        ("fish", "hsplat cit", [f"plain,cite\t{main.COMMANDS['cite']}"], "check"),
        ("powershell", "hsplat cit", [""], "cite"),
    ],
)
def test_the_words_that_may_come_next(
    shell: str, line: str, first: list[str], missing: str, folder: Path, monkeypatch, capsys
) -> None:
    words = line.split(" ")
    monkeypatch.setenv("_HSPLAT_COMPLETE", f"{shell}_complete")
    monkeypatch.setenv("COMP_WORDS", line)
    monkeypatch.setenv("COMP_CWORD", words[-1] if shell == "fish" else str(len(words) - 1))
    assert main.run([]) == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[: len(first)] == first
    assert missing not in out
    assert (err, list(folder.iterdir())) == ("", [])


def test_bash_completes_by_the_script(tmp_path: Path) -> None:
    (tmp_path / "hsplat").write_text(f'#!/bin/sh\nexec {sys.executable} -m hsplat_cli "$@"\n')
    (tmp_path / "hsplat").chmod(0o755)
    program = (
        'eval "$(hsplat completion bash)"; complete -p hsplat; COMP_WORDS=(hsplat prev); COMP_CWORD=1; '
        '_hsplat_completion hsplat; echo "${COMPREPLY[@]}"'
    )
    path = f"{tmp_path}:/usr/bin:/bin"
    done = subprocess.run(
        ["bash", "-c", program], env=environment(PATH=path), capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines() == ["complete -o nosort -F _hsplat_completion hsplat", "preview"]
    assert done.stderr == ""


def test_each_shell_has_a_script(capsys: pytest.CaptureFixture[str]) -> None:
    for shell, line in (("bash", "complete -o"), ("zsh", "#compdef hsplat"), ("fish", "complete --no-files --command")):
        assert main.run(["completion", shell]) == 0
        text = capsys.readouterr().out
        assert line in text and f"_HSPLAT_COMPLETE={shell}_complete" in text
