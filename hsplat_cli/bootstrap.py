"""Takes a fresh checkout to a first film or a test run: `python3 -m hsplat_cli.bootstrap demo` or `test`.

1. Checks for Python's venv and, for the tests, OpenGL without a screen. On Debian and its relatives root installs what
   is missing; other users get the line that an administrator has to run.
2. Makes `.venv` and installs hsplat into it as a wheel, unless it has these sources already.
3. Renders the demo to `demo.mp4`, or runs the tests, both with the installed wheel and not the checkout.

Uses the standard library alone. It must parse and explain itself on a Python that is too old for hsplat, down to 3.6:
no newer syntax, and annotations that need a newer Python in quotes.
"""

import hashlib
import importlib.util
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
INSTALL_RECORD = VENV / "hsplat-bootstrap.json"  # only this module writes it
SOURCES = ("pyproject.toml", "README.md", "LICENSE", "hsplat_cli", "renderer")
MIN_PYTHON = (3, 10)
GL_PACKAGES = ("libegl1", "libgl1", "libgl1-mesa-dri")


class SetupError(Exception):
    """A problem that the user has to solve; the text says which and how."""


def main(arguments: "list[str]") -> int:
    """Run the command in `arguments` and return the exit status."""
    if arguments not in (["demo"], ["test"]):
        print("usage: python3 -m hsplat_cli.bootstrap demo|test", file=sys.stderr)
        return 2
    try:
        require_python(sys.version_info[:2], sys.executable)
        require_checkout()
        require_system_packages(needs_opengl=arguments == ["test"])
        if arguments == ["demo"]:
            install("")
            return demo()
        install("[test]")
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
    # Not `python -m pytest`, which would import the checkout. Up to four processes; each takes whole files.
    lanes = ("--numprocesses=auto", "--maxprocesses=4", "--dist=loadfile")
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


def require_system_packages(*, needs_opengl: bool) -> None:
    """Install what is missing and pip cannot install; raise SetupError with instructions where that is not possible."""
    problems = find_system_problems(needs_opengl=needs_opengl)
    if not problems:
        return
    packages = [package for _, names in problems for package in names]
    if not shutil.which("apt-get"):
        found = "".join(f"\n  {problem}" for problem, _ in problems)
        raise SetupError(
            f"this machine lacks something that pip cannot install:{found}\n"
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
    remaining = find_system_problems(needs_opengl=needs_opengl)
    if remaining:
        raise SetupError("the packages are installed, and still: " + "; ".join(problem for problem, _ in remaining))


def find_system_problems(*, needs_opengl: bool) -> "list[tuple[str, tuple[str, ...]]]":
    """Return what is missing, each with the Debian packages that provide it."""
    problems: list[tuple[str, tuple[str, ...]]] = []
    if importlib.util.find_spec("venv") is None or importlib.util.find_spec("ensurepip") is None:
        version = version_text(sys.version_info[:2])
        problems.append((f"Python {version} without its venv module", (f"python{version}-venv",)))
    if not needs_opengl:
        return problems
    probe = Path(__file__).with_name("gl_probe.py")
    # In a new process: it finds libraries that were just installed, and a driver may crash.
    result = subprocess.run([sys.executable, str(probe)], stderr=subprocess.PIPE, check=False)
    if result.returncode != 0:
        # Drivers may print before the probe does.
        words = result.stderr.decode("utf-8", "replace").strip().splitlines() or [f"exit status {result.returncode}"]
        problems.append((f"OpenGL without a screen: {words[-1]}", GL_PACKAGES))
    return problems


def install(extra: str) -> None:
    """Install a wheel of these sources with the `extra` (such as `[test]`) and its libraries into `.venv`."""
    python = f"{version_text(sys.version_info[:2])} of {sys.base_prefix}"
    wanted = {"python": python, "sources": digest(), "extra": extra}
    present = read_install_record()
    if VENV.exists() and present is None:
        raise SetupError(f"{VENV} is there and was not made by this command. Move it away, then run this again.")
    if present is None or present.get("python") != python or not is_python_usable():
        make_venv()
        present = {}
    # An installation for the tests can also render the demo.
    if present.get("sources") == wanted["sources"] and present.get("extra") in (extra, "[test]"):
        return
    # While pip runs, only the Python is known.
    write_install_record({"python": python})
    say("installing hsplat and its libraries into .venv")
    with tempfile.TemporaryDirectory(prefix="hsplat-") as folder:
        # A copy: building leaves folders beside the sources, and the next build would take stale files from them.
        copy_sources(Path(folder))
        if run(VENV / "bin" / "python", "-m", "pip", "install", folder + extra, PIP_USER="0") != 0:
            raise SetupError("pip could not install hsplat; its reason is above.")
    write_install_record(wanted)


def make_venv() -> None:
    """Make an empty `.venv` again; the record comes first, so that a half-made one is known as ours."""
    say("making .venv")
    try:
        if VENV.exists():
            shutil.rmtree(str(VENV))
        VENV.mkdir()
        write_install_record({})
    except OSError as error:
        raise SetupError(f"{VENV} cannot be made: {error.strerror}.") from error
    if run(sys.executable, "-m", "venv", VENV) != 0:
        raise SetupError(f"{VENV} cannot be made; the reason is above.")


def is_python_usable() -> bool:
    """Return whether the Python of `.venv` still works."""
    try:
        return run(VENV / "bin" / "python", "-c", "import pip") == 0
    except SetupError:
        return False


def digest() -> str:
    """Return a digest of the names and contents of all that goes into the wheel."""
    result = hashlib.sha256()
    for name in SOURCES:
        for path in sorted([ROOT / name, *(ROOT / name).rglob("*")]):
            if path.is_file() and "__pycache__" not in path.parts:
                content = path.read_bytes()
                result.update(f"{path.relative_to(ROOT)}\0{len(content)}\0".encode())
                result.update(content)
    return result.hexdigest()


def copy_sources(folder: Path) -> None:
    """Copy all that goes into the wheel."""
    for name in SOURCES:
        source = ROOT / name
        if source.is_dir():
            shutil.copytree(str(source), str(folder / name), ignore=shutil.ignore_patterns("__pycache__"))
        elif source.exists():
            shutil.copy(str(source), str(folder / name))


def read_install_record() -> "dict[str, str] | None":
    """Return the record of what `.venv` has; None if this module did not make it."""
    try:
        record = json.loads(INSTALL_RECORD.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        return None
    except ValueError:
        return {}  # the write was interrupted
    return dict(record)


def write_install_record(record: "dict[str, str]") -> None:
    """Record what `.venv` has."""
    INSTALL_RECORD.write_text(json.dumps(record, indent=2) + "\n", encoding="utf-8")


def run(*command: object, **variables: str) -> int:
    """Run a program in the checkout and return its exit status; `variables` join its environment."""
    # PYTHONPATH and PYTHONHOME would put other code before that of .venv.
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONHOME")}
    environment.update(variables)
    words = [str(word) for word in command]
    try:
        return subprocess.run(words, cwd=str(ROOT), env=environment, check=False).returncode
    except OSError as error:
        raise SetupError(f"{words[0]} cannot be run: {error.strerror}.") from error


def version_text(version: "tuple[int, ...]") -> str:
    """Return (3, 10) as `3.10`."""
    return ".".join(str(number) for number in version)


def say(text: str) -> None:
    """Print the current step."""
    print(f"hsplat: {text}", flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
