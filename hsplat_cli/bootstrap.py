"""Everything from a fresh checkout to a first film or a test run: `python3 -m hsplat_cli.bootstrap demo` or `test`.

1. Python's venv is looked for, and for the tests OpenGL without a screen, which the demo does not need. On Debian and
   its kin, root installs what is missing; anybody else is told the line that an administrator has to run.
2. `.venv` is made, and hsplat installed into it as a wheel, unless it holds these very sources already.
3. The demo is rendered to `demo.mp4`, or the tests are run, both with the installed wheel and not the checkout.

Standard library only. It must also parse and explain itself on a Python that is too old for hsplat, down to 3.6: no
newer syntax here, and annotations that need a newer Python stay in quotes (a test says so).
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
MARK = VENV / "hsplat-bootstrap.json"  # written by this module only; says what was installed
SOURCES = ("pyproject.toml", "README.md", "LICENSE", "hsplat_cli", "renderer")
MIN_PYTHON = (3, 10)
GL_PACKAGES = ("libegl1", "libgl1", "libgl1-mesa-dri")


class SetupError(Exception):
    """Something that the user has to put right; the text says what and how."""


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
    """Render the demo, which needs no data, and say where the film is."""
    film = ROOT / "demo.mp4"
    say("rendering configs/demo.yaml")
    status = run(VENV / "bin" / "hsplat", "render", ROOT / "configs" / "demo.yaml", "--output", film)
    if status == 0:
        say(f"the film is {film}")
    return status


def test() -> int:
    """Run the tests on the installed wheel."""
    # Not `python -m pytest`: that would put the checkout before the wheel. Several at once, a file's tests by one.
    lanes = ("--numprocesses=auto", "--maxprocesses=4", "--dist=loadfile")
    return run(VENV / "bin" / "pytest", *lanes, HSPLAT_TEST_INSTALLED="1")


def require_python(version: "tuple[int, ...]", executable: str) -> None:
    """Raise SetupError on a Python that hsplat does not run on."""
    if tuple(version) < MIN_PYTHON:
        raise SetupError(
            f"Python {dotted(MIN_PYTHON)} or newer is needed, and {executable} is Python {dotted(version)}.\n"
            "Run this command again with a newer one, for example `python3.12 -m hsplat_cli.bootstrap`."
        )


def require_checkout() -> None:
    """Raise SetupError where there are no sources to install."""
    if not (ROOT / "pyproject.toml").is_file():
        raise SetupError(f"{ROOT} is not a checkout of hsplat: it has no pyproject.toml.")


def require_system_packages(*, needs_opengl: bool) -> None:
    """Look for what pip cannot install; install it where that is possible, else raise SetupError with the way to."""
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
    # The lists of packages may be absent or name versions that are gone. A foreign repository that fails is no reason
    # to give up: whether the packages can be had, the second command tells.
    run("apt-get", "update", DEBIAN_FRONTEND="noninteractive")
    if run(*command, DEBIAN_FRONTEND="noninteractive") != 0:
        raise SetupError(f"`{' '.join(command)}` failed; its reason is above.")
    remaining = find_system_problems(needs_opengl=needs_opengl)
    if remaining:
        raise SetupError("the packages are installed, and still: " + "; ".join(problem for problem, _ in remaining))


def find_system_problems(*, needs_opengl: bool) -> "list[tuple[str, tuple[str, ...]]]":
    """What is missing, each with the Debian packages that provide it."""
    problems: list[tuple[str, tuple[str, ...]]] = []
    if importlib.util.find_spec("venv") is None or importlib.util.find_spec("ensurepip") is None:
        version = dotted(sys.version_info[:2])
        problems.append((f"Python {version} without its venv module", (f"python{version}-venv",)))
    if not needs_opengl:
        return problems
    probe = Path(__file__).with_name("gl_probe.py")
    # In a process of its own: libraries that have just been installed are found, and a driver may crash.
    result = subprocess.run([sys.executable, str(probe)], stderr=subprocess.PIPE, check=False)
    if result.returncode != 0:
        # Drivers may complain before the probe has its say.
        words = result.stderr.decode("utf-8", "replace").strip().splitlines() or [f"exit status {result.returncode}"]
        problems.append((f"OpenGL without a screen: {words[-1]}", GL_PACKAGES))
    return problems


def install(extra: str) -> None:
    """Make `.venv` hold a wheel of these sources with the `extra` (such as `[test]`) and its libraries."""
    python = f"{dotted(sys.version_info[:2])} of {sys.base_prefix}"
    wanted = {"python": python, "sources": digest(), "extra": extra}
    present = read_install_record()
    if VENV.exists() and present is None:
        raise SetupError(f"{VENV} is there and was not made by this command. Move it away, then run this again.")
    if present is None or present.get("python") != python or not is_python_usable():
        make_venv()
        present = {}
    # What has the libraries of the tests can also render the demo.
    if present.get("sources") == wanted["sources"] and present.get("extra") in (extra, "[test]"):
        return
    # No more than this holds while pip is at work.
    write_install_record({"python": python})
    say("installing hsplat and its libraries into .venv")
    with tempfile.TemporaryDirectory(prefix="hsplat-") as folder:
        # A copy, because building leaves folders beside the sources, from which the next build takes stale files.
        copy_sources(Path(folder))
        if run(VENV / "bin" / "python", "-m", "pip", "install", folder + extra, PIP_USER="0") != 0:
            raise SetupError("pip could not install hsplat; its reason is above.")
    write_install_record(wanted)


def make_venv() -> None:
    """Make an empty `.venv` anew; the mark comes first, so that one left half made is known as ours."""
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
    """Whether the Python of `.venv` is still there."""
    try:
        return run(VENV / "bin" / "python", "-c", "import pip") == 0
    except SetupError:
        return False


def digest() -> str:
    """A fingerprint of names and contents of all that goes into the wheel."""
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
    """What `.venv` says to hold; None if it was not made here."""
    try:
        mark = json.loads(MARK.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        return None
    except ValueError:
        return {}  # cut off while it was written
    return dict(mark)


def write_install_record(mark: "dict[str, str]") -> None:
    """Say what `.venv` holds."""
    MARK.write_text(json.dumps(mark, indent=2) + "\n", encoding="utf-8")


def run(*command: object, **variables: str) -> int:
    """Run a program in the checkout and return its exit status; `variables` join its environment."""
    # PYTHONPATH and PYTHONHOME would put other code before what is installed in .venv.
    environment = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "PYTHONHOME")}
    environment.update(variables)
    words = [str(word) for word in command]
    try:
        return subprocess.run(words, cwd=str(ROOT), env=environment, check=False).returncode
    except OSError as error:
        raise SetupError(f"{words[0]} cannot be run: {error.strerror}.") from error


def dotted(version: "tuple[int, ...]") -> str:
    """(3, 10) as `3.10`."""
    return ".".join(str(number) for number in version)


def say(text: str) -> None:
    """Tell the user which step is being done."""
    print(f"hsplat: {text}", flush=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
