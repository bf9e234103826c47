"""What docstrings promise: whoever passes or receives an array reads its shape."""

import ast
import re
from pathlib import Path

SOURCE = Path(__file__).parents[1] / "src" / "helisim"

FILES = sorted(SOURCE.rglob("*.py"))

ARRAY = re.compile(r"\b(NDArray|ArrayLike)\b")
SHAPE = re.compile(r"\((?:[^()]*\bn_\w+,?[^()]*|\d+,|\d+(?:, \d+)+)\)|\bshape\b")
"""Such as (n_time,), (n_out, n_in, n_freq), (2 n_point,), (3,) or (3, 3); or the word itself."""


def public_functions(tree, owner=""):
    """Yield name, node and docstring of each public function and method of a module.

    What a class is made of stands in its own docstring, so that counts for `__init__`.
    """
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield from public_functions(node, f"{node.name}.")
        elif isinstance(node, ast.FunctionDef):
            if node.name == "__init__":
                yield f"{owner}__init__", node, ast.get_docstring(tree) or ""
            elif node.name == "__getitem__" or not node.name.startswith("_"):
                yield f"{owner}{node.name}", node, ast.get_docstring(node) or ""


def arrays(function):
    """Return the names of a function's arguments that are arrays, and "result" if that is one."""
    arguments = (*function.args.posonlyargs, *function.args.args, *function.args.kwonlyargs)
    found = [
        one.arg for one in arguments if one.annotation and ARRAY.search(ast.unparse(one.annotation))
    ]
    if function.returns is not None and ARRAY.search(ast.unparse(function.returns)):
        found.append("result")
    return found


def without_shapes(source):
    """Yield each public function whose docstring states fewer shapes than it has arrays.

    One shape is enough for several arrays if it is said of each.
    """
    for name, function, docstring in public_functions(ast.parse(source)):
        if "each" not in docstring and len(SHAPE.findall(docstring)) < len(arrays(function)):
            yield name


def test_array_docstrings_state_shapes():
    """No public function with an array leaves its shape to be guessed."""
    assert FILES
    missing = [
        f"{path.relative_to(SOURCE)}: {name}"
        for path in FILES
        for name in without_shapes(path.read_text(encoding="utf-8"))
    ]
    assert missing == [], "\n".join(missing)


def test_the_search_for_shapes_finds_what_lacks_one():
    """It sees arguments and results, methods too, and takes a bracket in prose for no shape."""
    source = """
def bare(x: NDArray[np.float64]) -> None:
    'Take x (an array, of course).'
class Made:
    'Of x, (n_time,).'
    def __init__(self, x: ArrayLike) -> None: ...
    def result(self) -> NDArray[np.float64] | None:
        'Return y.'
    def stated(self, x: ArrayLike) -> float:
        'Take x, (n_time,).'
    def half(self, x: ArrayLike) -> NDArray[np.float64]:
        'Return y, (n_time,).'
    def every(self, x: ArrayLike, y: ArrayLike) -> float:
        'Take x and y, (n_time,) each.'
    def _private(self, x: ArrayLike) -> float: ...
def vector(x: ArrayLike) -> float:
    'Return the length of x, (3,).'
def plain(x: float) -> float: ...
"""
    assert list(without_shapes(source)) == ["bare", "Made.result", "Made.half"]
