"""`bootstrap` takes a fresh checkout to an installed wheel; these tests change nothing on this machine."""

import ast
import os
import platform
import shutil
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from hsplat_cli import bootstrap

GL_PROBLEM = "OpenGL without a screen: libEGL.so.1 is not there"


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a small checkout that stands in for the real one."""
    for package in ("hsplat_cli", "renderer"):
        (tmp_path / package / "__pycache__").mkdir(parents=True)
        (tmp_path / package / "__init__.py").write_text("")
        (tmp_path / package / "__pycache__" / "cached.pyc").write_text("")
    (tmp_path / "pyproject.toml").write_text("[project]")
    for name, value in (
        ("ROOT", tmp_path),
        ("VENV", tmp_path / ".venv"),
        ("INSTALL_RECORD", tmp_path / ".venv" / "record.json"),
    ):
        monkeypatch.setattr(bootstrap, name, value)
    return tmp_path


class Runs:
    """Stands in for `bootstrap.run`: records the commands, which end with `status`."""

    def __init__(self) -> None:
        self.commands: list[str] = []
        self.status = 0

    def __call__(self, *command: object, **variables: str) -> int:
        self.commands.append(" ".join(str(word) for word in command))
        self.variables = variables
        return self.status

    def num_with(self, words: str) -> int:
        return sum(words in command for command in self.commands)


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> Runs:
    runs = Runs()
    monkeypatch.setattr(bootstrap, "run", runs)
    return runs


@pytest.fixture
def require_opengl(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Return a function that requires OpenGL, which the machine lacks after these checks, too; it has apt-get."""
    monkeypatch.setattr(shutil, "which", lambda name: f"/usr/bin/{name}")

    def require(*problems: str) -> None:
        left = iter(problems)
        bootstrap.require_packages(lambda: next(left), *bootstrap.GL_PACKAGES)

    return require


def test_an_old_python_can_read_the_module() -> None:
    tree = ast.parse(Path(bootstrap.__file__).read_text(), feature_version=(3, 6))
    imports = [node for node in ast.walk(tree) if isinstance(node, ast.Import | ast.ImportFrom)]
    names = {
        name
        for node in imports
        for name in ([node.module] if isinstance(node, ast.ImportFrom) else [a.name for a in node.names])
    }
    assert "__future__" not in names
    assert {str(name).split(".")[0] for name in names} <= sys.stdlib_module_names
    # Annotations of functions are evaluated: a newer form has to be a string.
    for function in (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)):
        arguments = [*function.args.args, function.args.vararg, function.args.kwarg]
        for annotation in [function.returns, *(argument.annotation for argument in arguments if argument)]:
            assert annotation is None or isinstance(annotation, ast.Name | ast.Constant), ast.dump(annotation)


def test_an_old_python_is_an_error() -> None:
    with pytest.raises(bootstrap.SetupError) as caught:
        bootstrap.require_python((3, 8), "/usr/bin/python3")
    assert str(caught.value) == (
        "Python 3.10 or newer is needed, and /usr/bin/python3 is Python 3.8.\n"
        "Run this command again with a newer one, for example `python3.12 -m hsplat_cli.bootstrap`."
    )
    bootstrap.require_python((3, 10), "/usr/bin/python3")


def test_other_commands_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    for arguments in ([], ["help"], ["demo", "test"]):
        assert bootstrap.main(arguments) == 2
        assert capsys.readouterr().err == "usage: python3 -m hsplat_cli.bootstrap demo|test\n"


def test_opengl_works_where_the_tests_run_and_its_absence_is_found(checkout: Path) -> None:
    (checkout / ".venv" / "bin").mkdir(parents=True)
    program, code = checkout / ".venv" / "bin" / "python", Path(bootstrap.__file__).parents[1]
    here = f'#!/bin/sh\nshift; PYTHONPATH={code} {{}} exec {sys.executable} "$@"'  # without -I: no wheel is installed
    program.write_text(here.format(""))
    program.chmod(0o755)
    assert bootstrap.find_opengl_problem() == ""
    program.write_text(here.format("__EGL_VENDOR_LIBRARY_FILENAMES=/nowhere"))
    problem = bootstrap.find_opengl_problem()
    assert problem.startswith("OpenGL without a screen: ") and "Error" not in problem


def test_an_ordinary_user_gets_the_line(runs: Runs, require_opengl: Callable[..., None], monkeypatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    with pytest.raises(bootstrap.SetupError) as caught:
        require_opengl(GL_PROBLEM)
    assert str(caught.value) == (
        "some packages are missing. An administrator has to run this line once:\n\n"
        "  apt-get update && apt-get install -y --no-install-recommends libegl1 libgl1 libgl1-mesa-dri\n\n"
        "Then run this command again."
    )
    assert runs.commands == []


def test_root_installs_what_is_missing(runs: Runs, require_opengl: Callable[..., None], monkeypatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    require_opengl(GL_PROBLEM, "")
    assert runs.commands == [
        "apt-get update",
        "apt-get install -y --no-install-recommends libegl1 libgl1 libgl1-mesa-dri",
    ]
    assert runs.variables == {"DEBIAN_FRONTEND": "noninteractive"}
    require_opengl("")
    assert len(runs.commands) == 2


@pytest.mark.parametrize(("status", "message"), [(100, "failed; its reason is above"), (0, "installed, and still")])
def test_packages_that_do_not_help_are_an_error(
    runs: Runs, require_opengl: Callable[..., None], monkeypatch: pytest.MonkeyPatch, status: int, message: str
) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    runs.status = status
    with pytest.raises(bootstrap.SetupError, match=message):
        require_opengl(GL_PROBLEM, GL_PROBLEM)


def test_a_machine_without_apt_is_an_error(require_opengl: Callable[..., None], monkeypatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda name: None)
    with pytest.raises(bootstrap.SetupError) as caught:
        require_opengl(GL_PROBLEM)
    assert str(caught.value) == (
        "this machine lacks something that pip cannot install:\n"
        "  OpenGL without a screen: libEGL.so.1 is not there\n"
        "On Debian and Ubuntu the packages are libegl1 libgl1 libgl1-mesa-dri; install their like."
    )


def test_only_changed_sources_and_more_libraries_are_installed(checkout: Path, runs: Runs) -> None:
    for extra, change in (("", ""), ("", ""), ("[test]", ""), ("", ""), ("", "new.py"), ("[test]", "")):
        if change:
            (checkout / "renderer" / change).write_text("")
        bootstrap.install(extra)
    assert runs.num_with("-m venv") == 1
    installs = [command for command in runs.commands if "pip install" in command]
    assert [command.endswith("[test]") for command in installs] == [False, True, False, True]


def test_another_python_gets_a_new_venv(checkout: Path, runs: Runs, monkeypatch: pytest.MonkeyPatch) -> None:
    bootstrap.install("")
    (checkout / ".venv" / "old").touch()
    monkeypatch.setattr(sys, "base_prefix", "/another")
    bootstrap.install("")
    assert runs.num_with("-m venv") == 2
    assert not (checkout / ".venv" / "old").exists()


def test_an_installation_that_failed_is_repeated(checkout: Path, runs: Runs) -> None:
    bootstrap.install("")
    (checkout / "renderer" / "__init__.py").write_text("changed")
    runs.status = 1
    with pytest.raises(bootstrap.SetupError):
        bootstrap.install("")
    runs.status = 0
    (checkout / "renderer" / "__init__.py").write_text("")
    bootstrap.install("")
    assert runs.commands[-1].split()[1:4] == ["-m", "pip", "install"]


def test_a_foreign_venv_is_left_alone(checkout: Path, runs: Runs) -> None:
    (checkout / ".venv").mkdir()
    (checkout / ".venv" / "theirs").touch()
    with pytest.raises(bootstrap.SetupError, match="was not made by this command"):
        bootstrap.install("")
    assert (checkout / ".venv" / "theirs").exists()
    assert runs.commands == []


def test_a_record_that_was_cut_off_is_ignored(checkout: Path, runs: Runs) -> None:
    (checkout / ".venv").mkdir()
    (checkout / ".venv" / "record.json").write_text('{"pyth')
    bootstrap.install("")
    assert runs.num_with("pip install") == 1


def test_the_copy_has_the_sources_and_nothing_else(checkout: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    (checkout / "build" / "lib").mkdir(parents=True)
    (checkout / "build" / "lib" / "stale.py").touch()
    (checkout / "LICENSE").write_text("MIT")
    target = tmp_path_factory.mktemp("copy")
    bootstrap.copy_sources(target)
    names = {str(path.relative_to(target)) for path in target.rglob("*") if path.is_file()}
    assert names == {"pyproject.toml", "LICENSE", "hsplat_cli/__init__.py", "renderer/__init__.py"}


def test_other_code_cannot_come_before_the_wheel(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", "/somewhere")
    code = "import os; raise SystemExit(7 if 'PYTHONPATH' not in os.environ and os.environ['ADDED'] == '1' else 1)"
    assert bootstrap.run(sys.executable, "-c", code, ADDED="1") == 7


def test_a_missing_program_is_an_error(checkout: Path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(sys, "executable", str(checkout / "absent"))
    monkeypatch.setattr(bootstrap, "find_venv_problem", str)
    assert bootstrap.main(["demo"]) == 1
    assert capsys.readouterr().err == f"hsplat: [Errno 2] No such file or directory: '{checkout / 'absent'}'\n"


SYSTEM = {"linux": "manylinux_2_17", "darwin": "macosx_11_0"}[sys.platform]
WHEEL = f"hsplat-0.1.0-py3-none-{SYSTEM}_{platform.machine()}.whl"
FILES = {"renderer/__init__.py": "", "hsplat_cli/__init__.py": "", "hsplat-0.1.0.dist-info/METADATA": "Name: hsplat"}
BUILT = {"renderer/kernels/built/kernels-1.so": "compiled"}


@pytest.mark.parametrize(
    ("name", "files", "age", "is_used"),
    [
        (WHEEL, FILES | BUILT, -60, True),
        (WHEEL, FILES, 60, False),
        ("hsplat-0.1.0-py3-none-another_system.whl", FILES, -60, False),
        (WHEEL, FILES | {"renderer/__init__.py": "changed"}, -60, False),
        (WHEEL, FILES | {"renderer/gone.py": ""}, -60, False),
        (WHEEL, {"renderer/__init__.py": ""}, -60, False),
        (WHEEL, {}, -60, False),
    ],
)
def test_a_wheel_of_these_sources_is_used(
    checkout: Path, runs: Runs, capsys: Any, name: str, files: dict[str, str], age: float, is_used: bool
) -> None:
    """A build is silent and long, so the step says how long it takes."""
    wheel = checkout / "dist" / name
    wheel.parent.mkdir()
    wheel.write_bytes(b"damaged")
    if files:
        with zipfile.ZipFile(wheel, "w") as archive:
            for member, text in files.items():
                archive.writestr(member, text)
    made = (checkout / "pyproject.toml").stat().st_mtime - age
    os.utime(wheel, (made, made))
    bootstrap.install("[test]")
    assert runs.commands[-1].endswith(f"{wheel}[test]") is is_used
    what = f"dist/{name} and its libraries into .venv"
    built = "hsplat and its libraries into .venv; the build takes several minutes"
    assert f"hsplat: installing {what if is_used else built}\n" in capsys.readouterr().out


def test_kernels_for_another_processor_are_made_again(checkout: Path, runs: Runs, monkeypatch) -> None:
    bootstrap.install("")
    assert runs.variables["HSPLAT_BUILD_LEVELS"] == "own"
    for is_usable, installs in ((True, 1), (False, 2)):
        monkeypatch.setattr(bootstrap, "are_kernels_usable", lambda is_usable=is_usable: is_usable)
        bootstrap.install("")
        assert runs.num_with("pip install") == installs
