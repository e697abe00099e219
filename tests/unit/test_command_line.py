"""The command hsplat has its exit codes and streams, no tracebacks, and starts without the heavy packages."""

from __future__ import annotations

import errno
import importlib
import os
import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import click
import pytest
from commands import HSPLAT, python

from hsplat_cli import main
from hsplat_cli.commands import check, compare, verify
from renderer.errors import InputError, RenderError

ROOT = Path(__file__).resolve().parents[2]
DEMO = ROOT / "configs" / "demo.yaml"

HEAVY = ("numpy", "moderngl", "tifffile", "pydicom", "nibabel", "imageio", "cmap")


def test_help_and_check_import_no_heavy_package(tmp_path: Path) -> None:
    (tmp_path / "scan.nrrd").write_bytes(b"NRRD0004")
    check = ["check", str(DEMO), "--no-cost"]
    commands = [["--help"], ["--version"], *([name, "--help"] for name in main.COMMANDS), check]
    commands += [[*check, "--frames", "::9", "--output", "new/{frame}.png", "--volume", str(tmp_path / "scan.nrrd")]]
    commands += [[*check, "--set", "transfer_function={colormap: viridis, range: [0, 9], opacity: [[0, 1]]}"]]
    program = (
        f"import sys; from hsplat_cli.main import run; codes = [run(command) for command in {commands}];"
        f"print([name for name in {HEAVY} if name in sys.modules], codes)"
    )
    assert python("-c", program).stdout.splitlines()[-1] == f"[] {[0] * len(commands)}"


@pytest.mark.parametrize("hidden", ["fcntl", "resource"])
def test_a_system_without_what_linux_and_macos_have_is_named(hidden: str) -> None:
    program = f"import sys; sys.modules[{hidden!r}] = None; from hsplat_cli.__main__ import main; main()"
    result = python("-c", program, "--help")
    assert (result.returncode, result.stdout) == (1, "")
    assert result.stderr == "hsplat: this system is not supported; hsplat runs on Linux and macOS\n"


# Between these limits OpenBLAS may end the process by itself, with its own words.
@pytest.mark.parametrize("limit_kib", [200_000, pytest.param(500_000, marks=pytest.mark.slow)])
def test_a_limit_of_address_space_is_named(limit_kib: int, tmp_path: Path) -> None:
    """Where a run meets it first depends on threads: as it reads the volume, in the encoder, or anywhere."""
    command = f"ulimit -v {limit_kib}; exec {sys.executable} -m hsplat_cli render {DEMO} --output {tmp_path}/demo.mp4"
    done = subprocess.run(["bash", "-c", command], cwd=ROOT, capture_output=True, text=True, check=False)
    hint = f"address space is limited to {limit_kib / 2**20:.2g} GiB here (ulimit -v); a run takes about 1 GiB"
    volume = "procedural engine_block: there is not enough memory for this volume\n"
    assert (done.returncode == 1 and f"\n  hint: {hint}\n" in done.stderr) or (
        done.returncode == 2 and done.stderr.startswith(volume)
    ), done.stderr


def test_module_and_help() -> None:
    done = python("-m", "hsplat_cli", "--help")
    assert (done.returncode, done.stderr) == (0, "")
    for name, summary in main.COMMANDS.items():
        assert f"  {name}" in done.stdout
        assert summary in done.stdout


def test_summaries_are_those_of_the_commands() -> None:
    for name, summary in main.COMMANDS.items():
        command = getattr(importlib.import_module(f"hsplat_cli.commands.{name}"), name)
        assert command.help.partition("\n\n")[0] == summary


def test_no_arguments_are_answered_with_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    main.run([])
    lines = "".join(capsys.readouterr()).splitlines()
    assert lines[0] == "Usage: hsplat [OPTIONS] COMMAND [ARGS]..."
    assert any(line.split()[:1] == ["render"] for line in lines)


def test_wrong_command_exits_with_2(capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["chekc", "x"]) == 2
    assert capsys.readouterr() == (
        "",
        f"hsplat has no command 'chekc'\n  expected: {', '.join(main.COMMANDS)}\n  hint: did you mean check?\n",
    )


def test_wrong_usage_exits_with_2(capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["check"]) == 2
    assert "Missing argument 'SCENE'" in capsys.readouterr().err
    assert main.run(["--colour"]) == 2
    assert "No such option" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["render", "check", "measure"])
def test_an_option_of_init_gets_the_key_as_a_hint(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run([command, "--size", "256", "256", str(DEMO)]) == 2
    assert capsys.readouterr().err.splitlines()[-2:] == [
        "Error: No such option '--size'.",
        "  hint: --set 'output.size=[512, 512]'",
    ]


@pytest.mark.parametrize(
    ("arguments", "where"),
    [
        (["init", "scan.npy", "--output=~/scene.yaml"], "--output"),
        (["turntable", "scan.npy", "--output=~"], "--output"),
        (["measure", "scene.yaml", "--output=~/report"], "--output"),
        (["golden", "scene.yaml", "--goldens=~/goldens"], "--goldens"),
        (["compare", "a", "b", "--report=~/report"], "--report"),
        (["verify", "film.mp4", "--json=~/result.json"], "--json"),
        (["render", str(DEMO), "--output=~/demo.mp4"], "--output ~/demo.mp4: output.file"),
    ],
)
def test_no_output_is_in_a_folder_named_tilde(arguments: list[str], where: str, folder, capsys) -> None:
    assert main.run(arguments) == 2
    text = capsys.readouterr().err
    assert text.startswith(f"{where}: a folder named ~\n")
    assert text.endswith("\n  hint: ~ is not expanded: write the whole path\n")
    assert not any(folder.iterdir())


Fail = Callable[[BaseException], int]


@pytest.fixture
def fail(monkeypatch: pytest.MonkeyPatch) -> Fail:
    """Return a function that runs a command which raises an exception, and returns the exit code."""

    def run(error: BaseException) -> int:
        @click.command()
        def failing() -> None:
            raise error

        monkeypatch.setattr(check, "check", failing)
        return main.run(["check"])

    return run


BUG = " (a bug; please report it, HSPLAT_DEBUG=1 shows the traceback)\n"


@pytest.mark.parametrize(
    ("error", "code", "message"),
    [
        (InputError("no voxels", where="a.nrrd"), 2, "a.nrrd: no voxels\n"),
        (RenderError("the disk is full", hint="make room"), 1, "the disk is full\n  hint: make room\n"),
        (KeyboardInterrupt(), 130, "hsplat: interrupted\n"),
        (KeyboardInterrupt(15), 143, "hsplat: interrupted\n"),
        (MemoryError(), 1, "hsplat: out of memory\n"),
        (RuntimeError("can't start new thread"), 1, "hsplat: out of memory\n"),
        (ImportError("libX.so: failed to map segment from shared object"), 1, "hsplat: out of memory\n"),
        (OSError(errno.ENOMEM, "Cannot allocate memory", "a.npy"), 1, "hsplat: out of memory\n"),
        (click.exceptions.Exit(1), 1, ""),
        (KeyError("a\nb"), 1, r"hsplat: unexpected KeyError: 'a\nb'" + BUG),
        (EOFError("two\nlines"), 1, r"hsplat: unexpected EOFError: two\nlines" + BUG),
        # Not that of the standard output, which is fine.
        (BrokenPipeError(32, "Broken pipe"), 1, "hsplat: unexpected BrokenPipeError: [Errno 32] Broken pipe" + BUG),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, BaseException) else None,
)
def test_every_error_is_a_message_and_a_code(fail: Fail, capsys, error: BaseException, code: int, message: str) -> None:
    assert fail(error) == code
    assert capsys.readouterr() == ("", message)


def test_a_lack_of_memory_is_found_behind_the_error_of_a_library(fail: Fail, capsys, monkeypatch) -> None:
    error = OSError("Could not find the library")
    error.__context__ = OSError("lib.so: failed to map segment from shared object")
    monkeypatch.setattr(resource, "getrlimit", lambda _: (1_500_000 * 1024, -1))
    assert fail(error) == 1
    assert capsys.readouterr().err == (
        "hsplat: out of memory\n  hint: address space is limited to 1.4 GiB here (ulimit -v); a run takes about 1 GiB\n"
    )


@pytest.mark.parametrize("module", [compare, verify])
@pytest.mark.parametrize("error", [RenderError("the disk is full"), MemoryError(), KeyError("a")])
def test_failures_of_what_finds_differences_have_the_code_2(
    monkeypatch: pytest.MonkeyPatch, error: BaseException, module: ModuleType
) -> None:
    @click.command()
    def failing() -> None:
        raise error

    name = module.__name__.rpartition(".")[2]
    monkeypatch.setattr(module, name, failing)
    assert main.run([name]) == 2


def test_a_variable_shows_the_traceback(fail: Fail, capsys, monkeypatch) -> None:
    monkeypatch.setenv("HSPLAT_DEBUG", "1")
    assert fail(KeyError("a")) == 1
    assert "Traceback" in capsys.readouterr().err


def test_a_closed_pipe_is_no_error() -> None:
    read_end, write_end = os.pipe()
    os.close(read_end)
    with os.fdopen(write_end, "wb") as pipe:
        done = subprocess.run(
            [*HSPLAT, "check", str(DEMO), "--no-cost"], cwd=ROOT, stdout=pipe, stderr=subprocess.PIPE, check=False
        )
    assert done.stderr == b""
    assert done.returncode == 1


def test_text_that_the_terminal_cannot_show_is_escaped(tmp_path: Path) -> None:
    scene = tmp_path / "scene.yaml"
    scene.write_text(DEMO.read_text(encoding="utf-8").replace("demo.mp4", "d\u0436mo.mp4"), encoding="utf-8")
    done = python("-m", "hsplat_cli", "check", str(scene), "--no-cost", PYTHONIOENCODING="latin-1")
    assert done.returncode == 0
    assert r"d\u0436mo.mp4" in done.stdout
