"""A mapped file that is truncated while it is read gives an error; no signal kills the job."""

from __future__ import annotations

import signal
from pathlib import Path

import numpy as np
import pytest
from commands import CODE, python
from small_scene import small_scene

SHAPE = (256, 512, 520)  # 65 MiB, more than what is read into memory
LEFT = 1_000_000

# What every Python of the job runs first. After a look at the file that found nothing, called from a function of this
# name, the file loses its end: just then whoever looked begins to read. Only in hsplat itself.
FIRST = """\
import os, sys
from pathlib import Path
caller = os.environ["HSPLAT_TEST_SHRINK"]
if "hsplat_cli" in sys.orig_argv:
    from renderer.volume import MappedFile
    look = MappedFile.require_unchanged
    def look_and_shrink(self):
        look(self)
        frame = sys._getframe(1)
        names = set()
        while frame is not None:
            names.add(Path(frame.f_code.co_filename).stem + "." + frame.f_code.co_name)
            frame = frame.f_back
        if caller in names:
            Path("was_here").write_text("")  # first: another process may see the file and end this one at once
            os.truncate(self.path, 1_000_000)
    MappedFile.require_unchanged = look_and_shrink
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """With a volume whose voxels are different everywhere that anything is visible."""
    values = np.zeros(SHAPE, np.uint8)
    values[150:230, 180:280, 180:330] = np.add.outer(np.arange(100), np.arange(150)) % 200 + 50
    np.save(tmp_path / "large.npy", values)
    (tmp_path / "sitecustomize.py").write_text(FIRST)
    return tmp_path


@pytest.mark.slow
@pytest.mark.parametrize(
    ("footprint", "caller"),
    [
        ("integrated", "fingerprint._read"),
        ("integrated", "building.work"),
        ("integrated", "brick_cache.placed"),
        pytest.param("gaussian", "cut._join_leaves", marks=pytest.mark.slow),
    ],
)
def test_between_a_look_and_the_reading(footprint: str, caller: str, folder: Path) -> None:
    whole = (folder / "large.npy").stat().st_size
    scene = small_scene(frames=4, error="tolerance: 0.01, probes: 16", footprint=footprint, volume="file: large.npy")
    (folder / "scene.yaml").write_text(scene)
    command = ("-m", "hsplat_cli", "render", "scene.yaml", "--quiet", "--output", "out/{frame}.png")
    done = python(*command, folder=folder, PYTHONPATH=f"{folder}:{CODE}", HSPLAT_TEST_SHRINK=caller)
    assert (folder / "was_here").exists()
    assert done.returncode == 2, (done.returncode, done.stderr)
    assert done.stderr.startswith(
        f"{folder / 'large.npy'}: the volume's file became shorter while it was in use\n"
        f"  got: {LEFT} bytes\n  expected: {whole} bytes, as when it was opened\n"
    )
    assert not list(folder.glob("out/*.png"))


# Guards an array that is mapped from one file, and reads one from another, which nobody guards, beyond its end.
STRANGER = """\
import os
import numpy as np
from renderer.volume import backing_file, guard_mapping
for name in ("ours", "another"):
    np.ones(1 << 20, np.uint8).tofile(name)
ours, another = np.memmap("ours", np.uint8, "r"), np.memmap("another", np.uint8, "r")
guard_mapping(backing_file(ours), ours)
os.truncate("ours", 5000)
assert int(ours.sum()) == 5000
os.truncate("another", 5000)
another.sum()
"""


SENT = """\
import os, signal
import numpy as np
from renderer.volume import backing_file, guard_mapping
np.ones(1 << 20, np.uint8).tofile("ours")
ours = np.memmap("ours", np.uint8, "r")
guard_mapping(backing_file(ours), ours)
assert int(ours.sum()) == 1 << 20
os.kill(os.getpid(), signal.SIGBUS)
"""


@pytest.mark.parametrize("program", [SENT, STRANGER], ids=["a signal that is sent", "another file"])
def test_other_faults_kill(program: str, tmp_path: Path) -> None:
    assert python("-c", program, folder=tmp_path).returncode == -signal.SIGBUS
