"""Regular expressions over text from outside take linear time, as does reading numbers in it."""

from __future__ import annotations

import ast
import importlib
import math
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import pytest
from linear_patterns import NotLinearError, require_linear

from renderer.system import attribute, number_in, unescaped, whole_number_in

ROOT = Path(__file__).resolve().parents[2]
_ANCHORED = {"match", "fullmatch"}
_SEARCHING = {"search", "findall", "finditer", "sub", "subn", "split"}
# The line that imports Python's module.
_IMPORT = re.compile(r"^\s*import re$", re.MULTILINE)
# What these read is part of the program, or typed on the command line: sources, pages just made, durations.
_OWN_TEXT = (
    "renderer/kernels/header.py",
    "renderer/draw/splats/programs.py",
    "hsplat_cli/reports/html.py",
    "hsplat_cli/terminal/arguments.py",
)


class Pattern(NamedTuple):
    """A pattern in the sources, and whether it may begin anywhere in a text."""

    where: str
    text: str | bytes | None
    flags: int
    is_search: bool


def _texts() -> dict[str, str]:
    """Return the sources by their paths, except those that read the program's own texts."""
    files = [path for package in ("renderer", "hsplat_cli") for path in sorted((ROOT / package).rglob("*.py"))]
    names = {str(path.relative_to(ROOT)): path for path in files}
    return {name: path.read_text("utf-8") for name, path in names.items() if name not in _OWN_TEXT}


def _value(node: ast.expr, module: ModuleType) -> Any:
    """Return what an expression stands for, with a letter in place of each local value in a text; None if unknown."""
    if isinstance(node, ast.JoinedStr):
        parts = (_value(each.value if isinstance(each, ast.FormattedValue) else each, module) for each in node.values)
        return "".join("x" if part is None else str(part) for part in parts)
    try:
        return eval(compile(ast.Expression(node), "pattern", "eval"), vars(module))
    except NameError:
        return None


def _methods(texts: Iterable[str]) -> dict[str, set[str]]:
    """Return the methods that are called of each name, in any module."""
    found: dict[str, set[str]] = {}
    for text in texts:
        for name, method in re.findall(r"\b(\w+)\.(\w+)", text):
            found.setdefault(name, set()).add(method)
    return found


def _patterns_of(name: str, text: str, methods: dict[str, set[str]]) -> Iterator[Pattern]:
    """Yield the patterns of a module; the text of a pattern is None if it is not known before the program runs."""
    tree, module = ast.parse(text), importlib.import_module(_module_name(name))
    nodes = [*ast.walk(tree)]
    targets = {
        id(node.value): node.targets[0].id
        for node in nodes
        if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name)
    }
    bound = {id(node.value): node.attr for node in nodes if isinstance(node, ast.Attribute)}
    for node in nodes:
        is_of_re = isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)
        if not is_of_re or not isinstance(node.func.value, ast.Name) or node.func.value.id != "re":
            continue
        kind = node.func.attr
        if kind == "escape":
            continue
        named = methods.get(targets.get(id(node), ""), set())
        called = {kind} if kind != "compile" else {bound[id(node)]} if id(node) in bound else named
        found = _value(node.args[0], module)
        given = [*node.args[{"compile": 1, "match": 2, "fullmatch": 2, "search": 2, "findall": 2}.get(kind, 9) :]]
        given += [each.value for each in node.keywords if each.arg == "flags"]
        yield Pattern(
            f"{name}:{node.lineno}",
            found if isinstance(found, str | bytes) else None,
            sum(int(_value(each, module)) for each in given),
            bool(called & _SEARCHING) or not called & _ANCHORED,
        )


def _module_name(path: str) -> str:
    return path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")


@pytest.fixture(scope="module")
def patterns() -> list[Pattern]:
    """Return all patterns in the sources."""
    texts = _texts()
    methods = _methods(texts.values())
    named = [(name, text) for name, text in texts.items() if _IMPORT.search(text)]
    return [pattern for name, text in named for pattern in _patterns_of(name, text, methods)]


# Patterns that are made when the program runs, and why they are linear.
_MADE = {
    "renderer/readers/foreign.py": "a table, of which each pattern is tested below",
    "renderer/scene/output_section.py": "digits between two texts without special characters",
}
_TABLE = (ROOT / "renderer" / "readers" / "foreign.tsv").read_text("utf-8").splitlines()[1:]


def test_patterns_of_the_sources_are_linear(patterns: list[Pattern]) -> None:
    problems = list[str]()
    for pattern in patterns:
        try:
            if pattern.text is not None:
                require_linear(pattern.text, pattern.flags, is_search=pattern.is_search)
        except NotLinearError as error:
            problems.append(f"{pattern.where}: {error}")
    assert problems == []


def test_patterns_that_are_not_tested_are_known(patterns: list[Pattern]) -> None:
    assert {pattern.where.partition(":")[0] for pattern in patterns if pattern.text is None} == {*_MADE}


@pytest.mark.parametrize("begin", [begin for line in _TABLE if (begin := line.split("\t")[1])])
def test_patterns_of_foreign_files_are_linear(begin: str) -> None:
    require_linear(begin.encode("ascii"), re.DOTALL, is_search=False)


@pytest.mark.parametrize(
    ("pattern", "is_search"),
    [
        (r"[0-9]+\.?[0-9]*", False),
        (r"(a+)+b", False),
        (r"(\d+[\s,]+.*[^\W\d_].*?)(\s+\d{4,})?", False),
        (r"(?m)^\s*DATASET\s", True),
        (r"\s+x", True),
        (r"([a-z]+)-color", True),
        (r"<A[^<>]*e=raw[^<>]*>", True),
        (r"(?:.*\n)*?x", False),
        (r"(x*y)*", False),
    ],
)  # fmt: skip
def test_patterns_that_backtrack_are_seen(pattern: str, is_search: bool) -> None:
    with pytest.raises(NotLinearError):
        require_linear(pattern, is_search=is_search)


@pytest.mark.parametrize(
    ("pattern", "is_search"),
    [
        (r"[0-9]+(?:\.[0-9]*)?", False),
        (r"[0-9]+", True),
        (r"<Piece\b[^<>]*", True),
        (r'"([^"]*)"', True),
        (r"(?m)^[ \t]*DATASET", True),
        (r"(.*\.)(hdr|img)(\.gz)?", False),
    ],
)  # fmt: skip
def test_patterns_that_are_linear_pass(pattern: str, is_search: bool) -> None:
    require_linear(pattern, is_search=is_search)


@pytest.mark.parametrize(("text", "number"), [("1", 1.0), ("-.5e2", -50.0), ("1.", 1.0), ("+3E-1", 0.3)])
def test_numbers_are_read(text: str, number: float) -> None:
    assert number_in(text) == number


@pytest.mark.parametrize("text", [None, "", "1_0", "nan", "inf", " 1", "1e", ".", "1" * 10**6 + "x", "\u0661"])
def test_other_texts_are_no_numbers(text: str | None) -> None:
    assert math.isnan(number_in(text))


def test_numbers_of_many_digits_are_read() -> None:
    assert number_in("1" * 10**6) == math.inf
    assert number_in("0." + "1" * 10**6) == pytest.approx(1 / 9)
    assert whole_number_in("-12") == -12
    assert whole_number_in("1" * 5000) is None and whole_number_in("--1") is None and whole_number_in("\u00b2") is None


def test_attributes_are_found_as_whole_words_in_either_quotes() -> None:
    element = """<A header_type="no" mytype='no' type = 'y"es' empty="" open="x"""
    assert attribute(element, "type") == 'y"es'
    assert attribute(element, "empty") == ""
    assert attribute(element, "open") is None and attribute(element, "y") is None


def test_references_of_many_digits_stay_as_they_are() -> None:
    assert unescaped("a &lt; &#98;") == "a < b"
    assert unescaped("&#" + "1" * 5000 + ";") == "&#" + "1" * 5000 + ";"
