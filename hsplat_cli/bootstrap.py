"""Installs a fresh checkout, then renders the demo or runs the tests: `python3 -m hsplat_cli.bootstrap demo` or `test`.

1. Checks for Python's venv. On Debian and its relatives root installs missing packages; other users get the command
   line that an administrator has to run.
2. Makes `.venv` and installs hsplat into it as a wheel, unless it has these sources already. A wheel in `dist` that has
   these sources saves the time to build one; for the demo, one is built for the level of this processor alone.
3. For the tests, checks for OpenGL without a screen, as in step 1.
4. Renders the demo to `demo.mp4`, or runs the tests, both with the installed wheel and not the checkout.

This file uses the standard library alone. On a Python that is too old for hsplat, down to 3.6, it must still parse and
print its message: it has no newer syntax, and quotes annotations that need a newer Python.
"""

import hashlib
import importlib.util
import json
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import Callable  # noqa: UP035  for an old Python

# The folder of the checkout of hsplat.
ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
# The file that records with which Python and from which sources this module made `.venv`. A `.venv` without it was made
# by somebody else.
INSTALL_RECORD = VENV / "hsplat-bootstrap.json"
# The files and folders of the checkout that a wheel is built from.
SOURCES = ("pyproject.toml", "setup.py", "README.md", "LICENSE", "hsplat_cli", "renderer")
# The oldest version of Python that hsplat runs on.
MIN_PYTHON = (3, 10)
# The Debian packages of OpenGL without a screen.
GL_PACKAGES = ("libegl1", "libgl1", "libgl1-mesa-dri")


class SetupError(Exception):
    """Reports a problem that the user has to solve; its text says how."""


def main(arguments: "list[str]") -> int:
    """Run the command in `arguments` and return the exit status."""
    if arguments not in (["demo"], ["test"]):
        print("usage: python3 -m hsplat_cli.bootstrap demo|test", file=sys.stderr)
        return 2
    try:
        require_python(sys.version_info[:2], sys.executable)
        require_checkout()
        require_packages(find_venv_problem, f"python{version_text(sys.version_info[:2])}-venv")
        if arguments == ["demo"]:
            install("")
            return demo()
        install("[test]")
        require_packages(find_opengl_problem, *GL_PACKAGES)
        return test()
    except (SetupError, OSError) as error:  # OSError: a full disk, a checkout that cannot be written
        print(f"hsplat: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("hsplat: interrupted", file=sys.stderr)
        return 130


def demo() -> int:
    """Render the demo, which needs no data, and print where the film is."""
    film = ROOT / "demo.mp4"
    say("rendering configs/demo.yaml")
    status = run(VENV / "bin" / "hsplat", "render", ROOT / "configs" / "demo.yaml", "--output", film)
    if status == 0:
        say(f"the film is {film}")
    return status


def test() -> int:
    """Run the tests on the installed wheel."""
    # Not `python -m pytest`, which would import the checkout. Up to four processes take whole files, in the files'
    # order: pytest-xdist would otherwise start files with few tests, such as one long test, last.
    lanes = ("--numprocesses=auto", "--maxprocesses=4", "--dist=loadfile", "--no-loadscope-reorder")
    return run(VENV / "bin" / "pytest", *lanes, HSPLAT_TEST_INSTALLED="1")


def require_python(version: "tuple[int, ...]", executable: str) -> None:
    """Raise SetupError for a Python that is too old."""
    if tuple(version) < MIN_PYTHON:
        raise SetupError(
            f"Python {version_text(MIN_PYTHON)} or newer is needed, "
            f"and {executable} is Python {version_text(version)}.\n"
            "Run this command again with a newer one, for example `python3.12 -m hsplat_cli.bootstrap`."
        )


def require_checkout() -> None:
    """Raise SetupError where the sources are missing."""
    if not (ROOT / "pyproject.toml").is_file():
        raise SetupError(f"{ROOT} is not a checkout of hsplat: it has no pyproject.toml.")


def require_packages(find_problem: "Callable[[], str]", *packages: str) -> None:
    """Install Debian packages if `find_problem` finds a problem; raise SetupError with instructions where it cannot."""
    problem = find_problem()
    if not problem:
        return
    if not shutil.which("apt-get"):
        raise SetupError(
            f"this machine lacks something that pip cannot install:\n  {problem}\n"
            f"On Debian and Ubuntu the packages are {' '.join(packages)}; install their like."
        )
    command = ["apt-get", "install", "-y", "--no-install-recommends", *packages]
    if os.geteuid() != 0:
        raise SetupError(
            "some packages are missing. An administrator has to run this line once:\n\n"
            f"  apt-get update && {' '.join(command)}\n\nThen run this command again."
        )
    say(f"installing {' '.join(packages)}")
    # The lists of packages may be absent or old. A foreign repository may fail: the second command tells whether the
    # packages can be installed.
    run("apt-get", "update", DEBIAN_FRONTEND="noninteractive")
    if run(*command, DEBIAN_FRONTEND="noninteractive") != 0:
        raise SetupError(f"`{' '.join(command)}` failed; its reason is above.")
    problem = find_problem()
    if problem:
        raise SetupError(f"the packages are installed, and still: {problem}")


def find_venv_problem() -> str:
    """Return a description of the missing part of Python without which `.venv` cannot be made, or an empty string."""
    if importlib.util.find_spec("venv") is not None and importlib.util.find_spec("ensurepip") is not None:
        return ""
    return f"Python {version_text(sys.version_info[:2])} without its venv module"


def find_opengl_problem() -> str:
    """Return the reason why OpenGL does not work without a screen, or an empty string; `.venv` must be there."""
    # Python runs isolated (-I), so that it imports the installed wheel.
    command = [str(VENV / "bin" / "python"), "-I", "-m", "hsplat_cli", "doctor", "--json"]
    result = subprocess.run(command, capture_output=True, check=False)
    try:
        parts = json.loads(result.stdout.decode("utf-8"))["optional"]
    except ValueError:
        words = result.stderr.decode("utf-8", "replace").strip().splitlines() or [f"exit status {result.returncode}"]
        return f"OpenGL without a screen: {words[-1]}"
    (problem,) = [part["problem"] for part in parts if part["name"] == "opengl"]
    return f"OpenGL without a screen: {problem}" if problem else ""


def install(extra: str) -> None:
    """Install a wheel of these sources with the `extra` (such as `[test]`) and its libraries into `.venv`."""
    python = f"{version_text(sys.version_info[:2])} of {sys.base_prefix}"
    present = read_install_record()
    if VENV.exists() and present is None:
        raise SetupError(f"{VENV} is there and was not made by this command. Move it away, then run this again.")
    if present is None or present.get("python") != python or not is_python_usable():
        make_venv()
        present = {}
    with tempfile.TemporaryDirectory(prefix="hsplat-") as folder:
        # A build leaves folders beside its sources, from which the next one would take old files: build from a copy.
        copy_sources(Path(folder))
        wanted = {"python": python, "sources": digest(Path(folder)), "extra": extra}
        # An installation for the tests can also render the demo.
        is_same = present.get("sources") == wanted["sources"] and present.get("extra") in (extra, "[test]")
        if is_same and are_kernels_usable():
            return
        # While pip runs, the record has only the Python: after an interrupt, pip runs again.
        write_install_record({"python": python})
        wheel = find_wheel(Path(folder))
        # pip prints nothing while it compiles.
        duration = "" if wheel else "; the build takes {} minutes".format("several" if extra else "about two")
        say(f"installing {wheel.relative_to(ROOT) if wheel else 'hsplat'} and its libraries into .venv{duration}")
        # Modules are compiled when they are first imported. Tests need the kernels of all levels of processors.
        command = [VENV / "bin" / "python", "-m", "pip", "install", "--no-compile", str(wheel or folder) + extra]
        if run(*command, PIP_USER="0", HSPLAT_BUILD_LEVELS="all" if extra else "own") != 0:
            raise SetupError("pip could not install hsplat; its reason is above.")
    write_install_record(wanted)


def are_kernels_usable() -> bool:
    """Return whether the hsplat in `.venv` has kernels for this processor, as the one that installed it had."""
    program = "import sys; sys.tracebacklimit = 0; from renderer.kernels import kernels; kernels()"
    return run(VENV / "bin" / "python", "-I", "-c", program) == 0


def find_wheel(sources: Path) -> "Path | None":
    """Return a wheel in the folder `dist` that was built for this system from these sources, or None.

    sources: a copy of them. A wheel has their packages, and is newer than the file that says what it depends on.
    """
    system = {"linux": "manylinux", "darwin": "macosx"}.get(sys.platform, sys.platform)
    for wheel in sorted((ROOT / "dist").glob(f"hsplat-*{system}*{platform.machine()}*.whl")):
        is_newer = wheel.stat().st_mtime > (ROOT / "pyproject.toml").stat().st_mtime
        if is_newer and has_sources(wheel, sources):
            return wheel
    return None


def has_sources(wheel: Path, sources: Path) -> bool:
    """Return whether the packages in a wheel are those of a folder, apart from compiled kernels."""
    wanted = {path.relative_to(sources).as_posix() for path in sources.glob("*/**/*.py")}
    try:
        with zipfile.ZipFile(str(wheel)) as archive:
            names = [name for name in archive.namelist() if ".dist-info/" not in name and "/built/" not in name]
            same = all(
                (sources / name).is_file() and (sources / name).read_bytes() == archive.read(name) for name in names
            )
            return same and wanted.issubset(names)
    except (OSError, zipfile.BadZipFile):
        return False


def make_venv() -> None:
    """Make an empty `.venv` again.

    The install record is written first, so that a later run knows a half-made folder as its own.
    """
    say("making .venv")
    if VENV.exists():
        shutil.rmtree(str(VENV))
    VENV.mkdir()
    write_install_record({})
    if run(sys.executable, "-m", "venv", VENV) != 0:
        raise SetupError(f"{VENV} cannot be made; the reason is above.")


def is_python_usable() -> bool:
    """Return whether the Python of `.venv` still works."""
    try:
        return run(VENV / "bin" / "python", "-c", "import pip") == 0
    except OSError:
        return False


def digest(folder: Path) -> str:
    """Return a digest of the names and contents of all files in a folder."""
    result = hashlib.sha256()
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        content = path.read_bytes()
        result.update(f"{path.relative_to(folder)}\0{len(content)}\0".encode())
        result.update(content)
    return result.hexdigest()


def copy_sources(folder: Path) -> None:
    """Copy the sources that a wheel is built from into a folder."""
    for name in SOURCES:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(str(source), str(folder / name), ignore=shutil.ignore_patterns("__pycache__"))
        elif source.exists():
            shutil.copy(str(source), str(folder / name))


def read_install_record() -> "dict[str, str] | None":
    """Return the record of the sources and extra that `.venv` has; None if this module did not make `.venv`."""
    try:
        record = json.loads(INSTALL_RECORD.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        return None
    except ValueError:
        return {}  # the write was interrupted
    return dict(record)


def write_install_record(record: "dict[str, str]") -> None:
    """Record the Python, sources and extra that `.venv` has."""
    INSTALL_RECORD.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")


def run(*command: object, **variables: str) -> int:
    """Run a program in the checkout and return its exit status. variables: added to the program's environment."""
    # Without PYTHONPATH and PYTHONHOME, which would put other code before the packages of .venv.
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONHOME")}
    environment.update(variables)
    words = [str(word) for word in command]
    return subprocess.run(words, cwd=str(ROOT), env=environment, check=False).returncode


def version_text(version: "tuple[int, ...]") -> str:
    """Return (3, 10) as `3.10`."""
    return ".".join(str(number) for number in version)


def say(text: str) -> None:
    """Print the current step."""
    print(f"hsplat: {text}", flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
