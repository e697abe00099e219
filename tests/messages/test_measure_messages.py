"""What a user reads when `hsplat measure` cannot do what was asked, and nothing is left lying."""

from __future__ import annotations

SMALL = ["--set", "camera.path.frames=6", "--set", "output.size=[32, 32]", "--set", "volume.procedural.shape=[8, 8, 8]"]
