"""Make bare Debian machines, and run both commands of the README in them, as root and as a user.

    sudo python3 tests/machines/bare_debian.py bookworm MIRROR FOLDER

A bare machine has Python with its venv module, certificates and what Debian cannot do without: no git, no compiler, no
OpenGL. debootstrap makes it from MIRROR, such as http://HOST/debian, and chroot runs it: it has this machine's kernel
and network, processes and mounts of its own, which end with each command, and the sources of the last commit. What pip
or the network need in addition, such as a certificate or pip.conf, is copied by `--copy FILE`.

As root both commands pass. As a user the second one ends with 1 and prints the line that an administrator has to run;
it passes after root has run that line. A table at the end says what passed, with seconds. FOLDER keeps the machines and
their logs. The exit status is 1 where a step did not end as expected.
"""

from __future__ import annotations

import argparse
import datetime
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DEMO = "python3 -m hsplat_cli.bootstrap demo && test -s demo.mp4"
TEST = "python3 -m hsplat_cli.bootstrap test"
PACKAGES = "python3,python3-venv,ca-certificates"
NETWORK = (Path("/etc/resolv.conf"), Path("/etc/hosts"))
PROXIES = ("http_proxy", "https_proxy", "no_proxy")
HOMES = {"root": "/root", "user": "/home/user"}
# The first process stays, as it has to wait for processes that their parent has left.
ENTER = """\
cd "$0"
mount -t proc proc proc
mount -t sysfs -o ro sysfs sys
mount -t devpts -o newinstance,gid=5,mode=620,ptmxmode=666 devpts dev/pts
mount -t tmpfs -o mode=1777 tmpfs dev/shm
chroot --userspec="$1" . bash -c 'cd "$HOME/hsplat" && '"$2"
exit $?
"""
NAMESPACES = ("unshare", "--mount", "--pid", "--fork", "--kill-child")  # mounts and processes end with the command
NUM_LINES = 40  # of a log that is printed


@dataclass(frozen=True)
class Step:
    """A command that has ended: its user, exit status, seconds, and what it printed."""

    user: str
    command: str
    expected: int
    status: int
    seconds: float
    printed: str

    @property
    def passed(self) -> bool:
        """Return whether the exit status is the expected one."""
        return self.status == self.expected

    @property
    def row(self) -> str:
        """Return the row of the table."""
        (last,) = self.printed.strip().splitlines()[-1:] or [""]
        last = last.replace(f"{HOMES[self.user]}/hsplat/", "")
        outcome = f"{self.status}" if self.passed else f"**{self.status}, expected {self.expected}**"
        return f"| {self.user} | `{self.command}` | {outcome} | {self.seconds:.0f} | {last.strip('= ')} |"


@dataclass(frozen=True)
class Machine:
    """A folder with a bare machine, in which one command at a time runs."""

    folder: Path

    def run(self, user: str, command: str, expected: int = 0) -> Step:
        """Run a command in the sources of this user; its output goes to a log beside the machine."""
        print(f"{self.folder.name}: {user} runs `{command}` ...", flush=True)
        environment = {name: os.environ[name] for name in PROXIES if name in os.environ}
        environment |= {"HOME": HOMES[user], "USER": user, "PATH": "/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin"}
        started = time.monotonic()
        with self.folder.with_suffix(".log").open("a+", encoding="utf-8", errors="replace") as log:
            start = log.seek(0, os.SEEK_END)
            status = subprocess.run(
                [*NAMESPACES, "bash", "-ec", ENTER, self.folder, user, command],
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                check=False,
            ).returncode
            log.seek(start)
            step = Step(user, command, expected, status, time.monotonic() - started, log.read())
        print(f"  exit status {status} after {step.seconds:.0f} s", flush=True)
        if not step.passed:
            print(*(f"  | {line}" for line in step.printed.splitlines()[-NUM_LINES:]), sep="\n", flush=True)
        return step


def as_root(machine: Machine) -> Iterator[Step]:
    """Run both commands; the second one installs OpenGL."""
    yield machine.run("root", DEMO)
    yield machine.run("root", TEST)


def as_user(machine: Machine) -> Iterator[Step]:
    """Run both commands; an administrator installs OpenGL as the second one says."""
    yield machine.run("user", DEMO)
    without_opengl = machine.run("user", TEST, expected=1)
    yield without_opengl
    (line,) = re.findall(r"(?m)^ +(apt-get .*)$", without_opengl.printed) or ["false"]  # no line: a step that fails
    yield machine.run("root", line)
    yield machine.run("user", TEST)


USERS: dict[str, Callable[[Machine], Iterator[Step]]] = {"root": as_root, "user": as_user}


def main() -> int:
    """Make the machines that the arguments name, run the commands, and print what passed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("suite", help="such as bookworm or trixie")
    parser.add_argument("mirror", help="URL of a Debian mirror")
    parser.add_argument("folder", type=Path, help="where the machines are made: a new folder, with 10 GB free")
    parser.add_argument("--users", nargs="+", choices=USERS, default=list(USERS), help="who runs the commands")
    parser.add_argument("--copy", type=Path, nargs="+", action="extend", default=[], help="files the machines get, too")
    options = parser.parse_args()
    if os.geteuid() != 0:
        parser.error("only root can make a machine")
    for program in ("debootstrap", "git", "unshare", "chroot"):
        if not shutil.which(program):
            parser.error(f"{program} is missing")
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as for Ctrl-C, what runs in a machine is killed
    base = options.folder.resolve() / options.suite
    options.folder.mkdir(parents=True)
    commit = read("git", "-C", ROOT, "rev-parse", "--short", "HEAD")
    make_base(base, options.mirror, commit, [*NETWORK, *options.copy])
    steps = []
    for user in options.users:
        for step in USERS[user](make_machine(base, user)):
            steps.append(step)
            if not step.passed:
                break
    version = read("chroot", base, "python3", "--version")
    release = (base / "etc/debian_version").read_text().strip()
    print(f"\nDebian {release}, {version}, commit {commit}, {datetime.date.today()}, {os.cpu_count()} cores\n")
    print("| user | command | exit status | seconds | its last line |\n|---|---|---|---|---|")
    print(*(step.row for step in steps), sep="\n")
    return 0 if all(step.passed for step in steps) else 1


def make_base(base: Path, mirror: str, commit: str, files: list[Path]) -> None:
    """Make the machine of which the others are copies; its name is the suite's, and each user has the sources."""
    print(f"making {base} ...", flush=True)
    with base.with_suffix(".log").open("w") as log:
        command = [*NAMESPACES, "debootstrap", "--variant=minbase", f"--include={PACKAGES}", base.name, base, mirror]
        if subprocess.run(command, stdout=log, stderr=subprocess.STDOUT, check=False).returncode != 0:
            raise SystemExit(f"debootstrap failed: its output is in {log.name}")
    for file in files:
        target = base / file.absolute().relative_to("/")
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(file, target)
    read("chroot", base, "useradd", "--create-home", "--shell", "/bin/bash", "user")
    archive = subprocess.run(["git", "-C", ROOT, "archive", commit], stdout=subprocess.PIPE, check=True).stdout
    for user, home in HOMES.items():
        sources = base / home.lstrip("/") / "hsplat"
        sources.mkdir()
        subprocess.run(["tar", "-x", "-C", sources], input=archive, check=True)
        read("chroot", base, "chown", "-R", user, f"{home}/hsplat")


def make_machine(base: Path, user: str) -> Machine:
    """Return a copy of the machine."""
    folder = base.with_name(f"{base.name}-{user}")
    read("cp", "-a", base, folder)
    return Machine(folder)


def read(*command: str | Path) -> str:
    """Return what a program prints, without the end of the line."""
    return subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout.strip()


if __name__ == "__main__":
    sys.exit(main())
