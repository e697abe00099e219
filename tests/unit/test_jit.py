"""Compiled loops work where there is no place for numba's cache, too."""

from __future__ import annotations

import types
from typing import Any

import pytest

from renderer.jit import jit


def test_a_file_system_that_cannot_be_written(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("HOME", "/proc/nowhere")  # where nobody, not even root, can make a folder

    def double(x: int) -> int:
        return 2 * x

    elsewhere: Any = types.FunctionType(double.__code__.replace(co_filename="/proc/nowhere/double.py"), {})
    assert jit(elsewhere)(21) == 42
