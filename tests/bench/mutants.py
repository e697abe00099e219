"""How many small faults in the product the tests find: `python tests/bench/mutants.py map|draw|run FOLDER [...]`.

1. `map FOLDER` runs the whole suite once, with pytest-cov and one context a test, and keeps in FOLDER which test runs
   which line and how long each takes.
2. `draw FOLDER --number 100 --seed 1` draws that many places of the product, evenly over all of its operators,
   comparisons, numbers, conditions, calls and raises, and writes FOLDER/mutants.json.
3. `run FOLDER` changes one place at a time in a copy of the checkout, runs the tests that cover it, the quickest first,
   up to the first failure, and writes what it saw to FOLDER/results.json. It resumes where it was stopped.

A line of a constant is run when it is imported: it counts as covered where a function that names it is. Needs
pytest-cov; takes hours, so nothing runs it but a person.
"""

from __future__ import annotations

import argparse
import ast
import json
import math
import os
import random
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from xml.etree import ElementTree

from coverage import CoverageData

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("renderer", "hsplat_cli")
MAX_TESTS_S = 600.0  # of one mutant, by the durations of the map

_COMPARISONS = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In,
}  # fmt: skip
_OPERATORS = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult,
    ast.Mod: ast.FloorDiv, ast.Pow: ast.Mult, ast.LShift: ast.RShift, ast.RShift: ast.LShift, ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """One change of one expression or statement: its place, its function, and its text before and after."""

    file: str
    function: str
    first_line: int
    last_line: int
    offset: int
    before: str
    after: str


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("step", choices=("map", "draw", "run"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--number", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    if arguments.step == "map":
        map_tests(arguments.folder)
    elif arguments.step == "draw":
        drawn = draw(arguments.number, arguments.seed)
        (arguments.folder / "mutants.json").write_text(json.dumps([asdict(mutant) for mutant in drawn], indent=1))
    else:
        run(arguments.folder)


def map_tests(folder: Path) -> None:
    """Run the suite once and keep its coverage, by test, and its durations."""
    environment = os.environ | {"COVERAGE_FILE": str(folder.resolve() / "coverage")}
    coverage = [*(f"--cov={package}" for package in PACKAGES), "--cov-context=test", "--cov-report="]
    command = [sys.executable, "-m", "pytest", "-q", "-n2", "--dist=loadfile", *coverage]
    subprocess.run([*command, f"--junit-xml={folder / 'durations.xml'}"], cwd=ROOT, env=environment, check=False)


def draw(number: int, seed: int) -> list[Mutant]:
    """Draw places evenly over the product."""
    return random.Random(seed).sample([mutant for path in sources() for mutant in mutants_of(path)], number)


def sources() -> list[Path]:
    """Return the files of the product."""
    return sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))


def mutants_of(path: Path) -> Iterator[Mutant]:
    """Yield every change that can be made to a file."""
    source = path.read_text("utf-8")
    starts = [0]
    for line in source.encode().splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    for node, function in _nodes(ast.parse(source), ""):
        after = _changed(node)
        if after is not None and isinstance(node, (ast.expr, ast.stmt)):
            begin, end = starts[node.lineno - 1] + node.col_offset, starts[node.end_lineno - 1] + node.end_col_offset  # type: ignore[operator]
            before = source.encode()[begin:end].decode()
            last = node.end_lineno or node.lineno
            yield Mutant(str(path.relative_to(ROOT)), function, node.lineno, last, begin, before, after)


def _nodes(parent: ast.AST, function: str) -> Iterator[tuple[ast.AST, str]]:
    """Yield the nodes that are run, with the names of their functions; no annotations, decorators or docstrings."""
    for name, value in ast.iter_fields(parent):
        if name in ("annotation", "returns", "decorator_list", "format_spec"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if not isinstance(child, ast.AST) or isinstance(child, ast.JoinedStr):
                continue
            is_named = isinstance(child, (ast.FunctionDef, ast.ClassDef))
            inner = f"{function}.{child.name}".lstrip(".") if is_named else function
            yield child, inner
            yield from _nodes(child, inner)


def _changed(node: ast.AST) -> str | None:
    """Return the text of a node with one fault in it; None for nodes that get none."""
    match node:
        case ast.Compare(ops=[operator, *_]) if type(operator) in _COMPARISONS:
            return _text(ast.Compare(node.left, [_COMPARISONS[type(operator)](), *node.ops[1:]], node.comparators))
        case ast.BinOp(op=operator) if type(operator) in _OPERATORS and not _is_text(node):
            return _text(ast.BinOp(node.left, _OPERATORS[type(operator)](), node.right))
        case ast.BoolOp(op=operator):
            return _text(ast.BoolOp(ast.Or() if isinstance(operator, ast.And) else ast.And(), node.values))
        case ast.UnaryOp(op=ast.Not() | ast.USub()):
            return _text(node.operand)
        case ast.IfExp():
            return _text(ast.IfExp(ast.UnaryOp(ast.Not(), node.test), node.body, node.orelse))
        case ast.Constant(value=bool(value)):
            return str(not value)
        case ast.Constant(value=int(value)):
            return str(value + 1)
        case ast.Constant(value=float(value)) if math.isfinite(value):
            return repr(2 * value if value else 1.0)
        case ast.Call(func=ast.Name(id=("min" | "max") as name)):
            return _text(ast.Call(ast.Name("max" if name == "min" else "min"), node.args, node.keywords))
        case ast.Expr(value=ast.Call()) | ast.AugAssign() | ast.Raise():
            return "pass"
    return None


def _is_text(node: ast.BinOp) -> bool:
    return any(isinstance(part, (ast.JoinedStr, ast.List, ast.Tuple)) or getattr(part, "value", None).__class__ is str
               for part in (node.left, node.right))  # fmt: skip


def _text(node: ast.expr) -> str:
    return f"({ast.unparse(ast.fix_missing_locations(node))})"


class Coverage:
    """The map: which tests run a mutant."""

    def __init__(self, folder: Path) -> None:
        data = CoverageData(str(folder / "coverage"))
        data.read()
        self._lines = {
            str(Path(path).relative_to(ROOT)): {
                number: {context.rpartition("|")[0] for context in contexts} - {""}  # without setup, run, teardown
                for number, contexts in data.contexts_by_lineno(path).items()
            }
            for path in data.measured_files()
        }
        self._durations: dict[str, float] = {}
        self._failed: set[str] = set()
        for case in ElementTree.parse(folder / "durations.xml").iter("testcase"):
            name = case.get("classname", "").replace(".", "/") + ".py::" + case.get("name", "")
            self._durations[name] = float(case.get("time", 0))
            if case.find("failure") is not None or case.find("error") is not None:
                self._failed.add(name)
        self._functions = [function for path in sources() for function in _functions_of(path)]

    def _tests_between(self, file: str, first_line: int, last_line: int) -> set[str]:
        lines = self._lines.get(file, {})
        return set().union(*(lines.get(number, ()) for number in range(first_line, last_line + 1)))

    def tests_of(self, mutant: Mutant) -> list[str]:
        """Return the tests that run a mutant, the quickest first, no more than MAX_TESTS_S of them."""
        tests = self._tests_between(mutant.file, mutant.first_line, mutant.last_line)
        if _is_run_at_import(mutant):
            names = _names_set_at(mutant)
            for file, first, last, used in self._functions:
                if names & used:
                    tests |= self._tests_between(file, first, last)
        picked, seconds = [], 0.0
        for test in sorted(tests - self._failed, key=lambda name: (self._durations.get(name, 1.0), name)):
            seconds += self._durations.get(test, 1.0)
            if seconds > MAX_TESTS_S and picked:
                break
            picked.append(test)
        return picked


def _functions_of(path: Path) -> Iterator[tuple[str, int, int, frozenset[str]]]:
    """Yield, of each function of a file, the file, the lines of its body, and the names that it uses."""
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.FunctionDef):
            used = {part.id for part in ast.walk(node) if isinstance(part, ast.Name)}
            used |= {part.attr for part in ast.walk(node) if isinstance(part, ast.Attribute)}
            last = node.end_lineno or node.lineno
            yield str(path.relative_to(ROOT)), node.body[0].lineno, last, frozenset(used)


def _is_run_at_import(mutant: Mutant) -> bool:
    functions = [node for node in ast.walk(_tree_of(mutant)) if isinstance(node, (ast.FunctionDef, ast.Lambda))]
    return not any(node.lineno <= mutant.first_line <= (node.end_lineno or 0) for node in functions)


def _names_set_at(mutant: Mutant) -> set[str]:
    """Return the names that a statement at the top of a file or of a class binds."""
    names: set[str] = set()
    for node in ast.walk(_tree_of(mutant)):
        if isinstance(node, (ast.Assign, ast.AnnAssign)) and node.lineno <= mutant.first_line <= (node.end_lineno or 0):
            names |= {
                part.id for part in ast.walk(node) if isinstance(part, ast.Name) and isinstance(part.ctx, ast.Store)
            }
    return names


def _tree_of(mutant: Mutant) -> ast.Module:
    return ast.parse((ROOT / mutant.file).read_text("utf-8"))


def run(folder: Path) -> None:
    """Try each mutant that has no result yet, and print how many were found."""
    drawn = [Mutant(**values) for values in json.loads((folder / "mutants.json").read_text())]
    path = folder / "results.json"
    results = json.loads(path.read_text()) if path.exists() else {}
    coverage = Coverage(folder)
    copy = folder.resolve() / "copy"
    if not copy.exists():
        subprocess.run(["git", "clone", "-q", str(ROOT), str(copy)], check=True)
        subprocess.run([sys.executable, "-m", "renderer.kernels.build"], check=True, cwd=copy)
    for number, mutant in enumerate(drawn):
        if str(number) not in results:
            tests = coverage.tests_of(mutant)
            found, seconds = _try(mutant, tests, copy) if tests else (False, 0.0)
            results[str(number)] = {"found": found, "tests": len(tests), "seconds": round(seconds, 1)}
            path.write_text(json.dumps(results, indent=1))
            print(number, mutant.file, mutant.function, found, len(tests), f"{seconds:.0f} s", flush=True)
    print(f"{sum(result['found'] for result in results.values())} of {len(results)} mutants are found")


def _try(mutant: Mutant, tests: list[str], copy: Path) -> tuple[bool, float]:
    """Return whether any test fails with a mutant in place; a suite that hangs has found it, too."""
    target = copy / mutant.file
    source = (ROOT / mutant.file).read_bytes()
    end = mutant.offset + len(mutant.before.encode())
    target.write_bytes(source[: mutant.offset] + mutant.after.encode() + source[end:])
    listed = copy.parent / "tests.txt"
    listed.write_text("\n".join(tests))
    begin = time.monotonic()
    try:
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", f"@{listed}"]
        result = subprocess.run(command, cwd=copy, capture_output=True, timeout=4 * MAX_TESTS_S, check=False)
        # A mutant may break even the collection of its tests (2, 3); 4 and 5 say that there is no such test.
        assert result.returncode < 4, result.stdout.decode()
        found = result.returncode != 0
    except subprocess.TimeoutExpired:
        found = True
    finally:
        target.write_bytes(source)
    return found, time.monotonic() - begin


if __name__ == "__main__":
    main()
