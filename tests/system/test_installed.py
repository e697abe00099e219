"""The tests import the installed wheel where they should, else this checkout."""

import os
import sysconfig
from importlib import import_module
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("package", ["renderer", "hsplat_cli"])
def test_where_the_code_comes_from(package: str) -> None:
    installed = os.environ.get("HSPLAT_TEST_INSTALLED") == "1"
    expected = Path(sysconfig.get_path("purelib")).resolve() if installed else CHECKOUT
    file = import_module(package).__file__
    assert file is not None
    assert Path(file).resolve() == expected / package / "__init__.py"
    assert (expected / package / "py.typed").exists(), "type checkers read the types of a package with this file"
