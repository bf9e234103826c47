"""Hold the size of `src/helisim` to `.ci/ceilings.toml`, and its imports to one direction.

Prints a line a package: files, lines, executable statements (all but imports, definitions and bare
strings), and the ceiling. Fails above a ceiling, for a package without one, for an import circle
(imports for types and within functions count), and for an option of the command line (`--name`) in
a text below `cli`. Whoever has a reason to grow a package edits the ceilings.
"""

import ast
import re
import sys
import tomllib
from collections import Counter, defaultdict
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).parents[1]
SOURCE = ROOT / "src" / "helisim"
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]+")
DEFINITIONS = (ast.Import, ast.ImportFrom, ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)


def is_bare_text(node: ast.AST) -> bool:
    """Return whether a statement is a docstring or another constant alone."""
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)


def statements(tree: ast.Module) -> int:
    """Count the executable statements of a module."""
    found = (node for node in ast.walk(tree) if isinstance(node, ast.stmt))
    return sum(not isinstance(node, DEFINITIONS) and not is_bare_text(node) for node in found)


def imports(tree: ast.Module, modules: set[str]) -> set[str]:
    """Return the modules of the package that a module names, wherever it does."""
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("helisim"):
            for one in node.names:
                inner = f"{node.module}.{one.name}"
                found.add(inner if inner in modules else node.module)
    return found & modules


def main() -> int:
    """Print the sizes and return how many faults there are."""
    ceilings = tomllib.loads((ROOT / ".ci" / "ceilings.toml").read_text(encoding="utf-8"))
    paths = sorted(SOURCE.rglob("*.py"))
    texts = {path: path.read_text(encoding="utf-8") for path in paths}
    trees = {path: ast.parse(text) for path, text in texts.items()}
    names = {
        path: ".".join(path.relative_to(ROOT / "src").with_suffix("").parts).removesuffix(
            ".__init__"
        )
        for path in paths
    }
    sizes: dict[str, Counter[str]] = defaultdict(Counter)
    faults = []
    for path, tree in trees.items():
        inner = path.relative_to(SOURCE).parts
        package = inner[0] if len(inner) > 1 else "helisim"
        size = {"files": 1, "lines": texts[path].count("\n"), "statements": statements(tree)}
        sizes[package].update(size)
        sizes["all"].update(size)
        if package != "cli":
            said = (node for node in ast.walk(tree) if isinstance(node, ast.Constant))
            options = [one for node in said for one in OPTION.findall(str(node.value))]
            faults += [
                f"{names[path]} names the option {one} of the command line" for one in options
            ]
    print(f"{'package':10}{'files':>7}{'lines':>8}{'statements':>12}{'ceiling':>9}")
    for package, size in sorted(sizes.items()):
        ceiling = ceilings.get(package)
        row = f"{package:10}{size['files']:7}{size['lines']:8}{size['statements']:12}"
        print(f"{row}{ceiling if ceiling is not None else '-':>9}")
        if ceiling is None or size["statements"] > ceiling:
            faults.append(f"{package}: {size['statements']} statements, ceiling {ceiling}")
    known = set(names.values())
    graph = {names[path]: imports(tree, known) - {names[path]} for path, tree in trees.items()}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        faults.append(f"modules import each other: {' -> '.join(reversed(error.args[1]))}")
    for fault in faults:
        print(fault)
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main())
