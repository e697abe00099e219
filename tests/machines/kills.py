"""Kill films of several files at random moments, and see that nothing is harmed.

    python3 tests/machines/kills.py [NUMBER] [SEED]

Films are killed by SIGKILL, each up to three times, and made to their ends, until NUMBER (200) were killed. After a
kill no input has changed, and each output is missing or whole; at the end all files have the bytes of a film that
nobody killed, and no other file is there. The exit status is 1 where that is not so.
"""

from __future__ import annotations

import hashlib
import importlib
import os
import random
import shutil
import signal
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from PIL import Image

import hsplat_cli.main

SCENE = """\
version: 1
volume: {file: scan.npy}
transfer_function: {colormap: viridis, range: [0, 1], opacity: [[0.1, 0], [1, 0.5]]}
camera: {path: {type: turntable, frames: 6}}
annotation: {logo: films/logo.png, title: film}
output: [FIRST, {file: films/b.webm}, {file: other/c.gif, every: 2}, {file: films/p.png, frame: 3},
  {file: 'other/{frame}.png', size: [64, 64], every: 3}]
"""
FIRST = ("{file: films/a.mp4, size: [128, 128]}", "{file: 'films/{frame}.png', size: [128, 128]}")
# Of the kills of one film.
MOST_KILLS = 3


def main(number: int = 200, seed: int = 1) -> None:
    """Kill films, tell what was harmed, and exit."""
    choose, num_kills, problems = random.Random(seed), 0, list[str]()
    with tempfile.TemporaryDirectory() as name:
        for kind, first in enumerate(FIRST, start=1):
            whole, scene = Path(name, f"whole-{kind}"), SCENE.replace("FIRST", first)
            make_inputs(whole, scene)
            inputs = digests(whole)
            load_modules(whole)
            shutil.rmtree(whole)
            make_inputs(whole, scene)
            start = time.monotonic()
            assert run(whole) == 0
            seconds, expected = time.monotonic() - start, digests(whole)
            while num_kills < number * kind // len(FIRST):
                folder = Path(name, "film")
                shutil.rmtree(folder, ignore_errors=True)
                make_inputs(folder, scene)
                moments = [choose.uniform(0.2, 1.1) * seconds for _ in range(choose.randint(1, MOST_KILLS))]
                num_new, found = try_film(folder, moments, expected, {*inputs})
                num_kills += num_new
                problems += [f"after {num_kills} kills: {each}" for each in found]
                print(f"{num_kills} kills, {len(problems)} problems", file=sys.stderr)
    print("\n".join([*problems, f"{num_kills} kills, {len(problems)} problems"]))
    sys.exit(bool(problems))


def try_film(folder: Path, moments: list[float], expected: dict[str, str], inputs: set[str]) -> tuple[int, list[str]]:
    """Make a film that is killed at these moments, in seconds; return the number of kills, and what was harmed."""
    num_kills, problems = 0, list[str]()
    for moment in moments:
        num_kills += run(folder, moment) == -signal.SIGKILL
        problems += harmed(digests(folder), expected, inputs)
    status, left = run(folder), digests(folder)
    if status or left != expected:
        names = sorted(each for each in {*left, *expected} if left.get(each) != expected.get(each))
        problems.append(f"made with status {status}, and other files: {names}")
    return num_kills, problems


def make_inputs(folder: Path, scene: str) -> None:
    """Write the inputs of a film."""
    for each in (folder, folder / "films", folder / "other"):
        each.mkdir()
    z, y, x = np.meshgrid(*[np.linspace(-1, 1, 24)] * 3, indexing="ij")
    np.save(folder / "scan.npy", np.exp(-3 * (x * x + y * y + z * z)).astype(np.float32))
    Image.new("RGBA", (20, 20), "red").save(folder / "films/logo.png")
    (folder / "scene.yaml").write_text(scene, "utf-8")


def load_modules(folder: Path) -> None:
    """Make a film in a child process, and import here what it has imported."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.chdir(folder)
        status = hsplat_cli.main.run(["render", "scene.yaml", "--quiet"])
        os.write(
            write, " ".join(name for name in sys.modules if name.startswith(("renderer.", "hsplat_cli."))).encode()
        )
        os._exit(status)
    os.close(write)
    with open(read, "rb") as pipe:
        names = pipe.read().decode().split()
    assert os.waitpid(child, 0)[1] == 0
    for name in names:
        importlib.import_module(name)


def run(folder: Path, kill_after: float | None = None) -> int:
    """Make a film in a child process, which has all modules already; return its status, or the signal's, negative.

    kill_after: seconds after which it is killed, unless it has ended.
    """
    child = os.fork()
    if child == 0:
        os.chdir(folder)
        os._exit(hsplat_cli.main.run(["render", "scene.yaml", "--quiet"]))
    if kill_after is not None:
        time.sleep(kill_after)
        os.kill(child, signal.SIGKILL)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def digests(folder: Path) -> dict[str, str]:
    """Return what each file has, by its name; of sidecars, which tell seconds, that they are there."""
    found = {}
    for path in folder.rglob("*"):
        if path.is_file():
            is_sidecar = path.suffix == ".json"
            found[str(path.relative_to(folder))] = "" if is_sidecar else hashlib.sha256(path.read_bytes()).hexdigest()
    return found


def harmed(now: dict[str, str], expected: dict[str, str], inputs: set[str]) -> list[str]:
    """Return the inputs that have changed, outputs that are not whole, and files that are no unfinished work."""
    changed = [f"the input {name} has changed" for name in sorted(inputs) if now.get(name) != expected[name]]
    torn = [f"{name} is not whole" for name in sorted(now) if name in expected and now[name] != expected[name]]
    others = [f"{name} is left" for name in sorted(now) if name not in expected and ".unfinished/" not in name]
    return changed + torn + others


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
