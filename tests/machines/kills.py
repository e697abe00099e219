"""Kill films of several files at random moments, and see that nothing is harmed.

    python3 tests/machines/kills.py [NUMBER] [SEED]

Each of NUMBER films (200) is killed by SIGKILL up to three times, then made to its end. After each kill no input has
changed, and each output is missing or whole; at the end all files have the bytes of a film that nobody killed, and no
other file is there. The exit status is 1 where that is not so.
"""

from __future__ import annotations

import hashlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from PIL import Image

CODE = Path(__file__).resolve().parents[2]
COMMAND = (sys.executable, "-m", "hsplat_cli", "render", "scene.yaml", "--quiet")
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
        for kind, first in enumerate(FIRST):
            whole = Path(name, f"whole-{kind}")
            inputs = make_inputs(whole, SCENE.replace("FIRST", first))
            start = time.monotonic()
            run(whole).wait()
            seconds, expected = time.monotonic() - start, digests(whole)
            for film in range(kind, number, len(FIRST)):
                folder = Path(name, "film")
                shutil.rmtree(folder, ignore_errors=True)
                make_inputs(folder, SCENE.replace("FIRST", first))
                for _ in range(choose.randint(1, MOST_KILLS)):
                    num_kills += kill(folder, choose.uniform(0.2, 1.1) * seconds)
                    problems += [f"film {film}: {each}" for each in harmed(digests(folder), expected, inputs)]
                status = run(folder).wait()
                left = digests(folder)
                if status or left != expected:
                    names = sorted(each for each in {*left, *expected} if left.get(each) != expected.get(each))
                    problems.append(f"film {film}: made with status {status}, and other files: {names}")
    print("\n".join([*problems, f"{number} films, {num_kills} kills, {len(problems)} problems"]))
    sys.exit(bool(problems))


def make_inputs(folder: Path, scene: str) -> set[str]:
    """Write the inputs of a film, and return their names."""
    for each in (folder, folder / "films", folder / "other"):
        each.mkdir()
    z, y, x = np.meshgrid(*[np.linspace(-1, 1, 24)] * 3, indexing="ij")
    np.save(folder / "scan.npy", np.exp(-3 * (x * x + y * y + z * z)).astype(np.float32))
    Image.new("RGBA", (20, 20), "red").save(folder / "films/logo.png")
    (folder / "scene.yaml").write_text(scene, "utf-8")
    return {*digests(folder)}


def run(folder: Path) -> subprocess.Popen[bytes]:
    """Start a film."""
    return subprocess.Popen(COMMAND, cwd=folder, env=os.environ | {"PYTHONPATH": str(CODE)})


def kill(folder: Path, seconds: float) -> bool:
    """Start a film and kill it after some seconds; return whether it was not at its end before."""
    process = run(folder)
    time.sleep(seconds)
    process.send_signal(signal.SIGKILL)
    return process.wait() == -signal.SIGKILL


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
