"""Mutation testing of an area: the share of small faults that its tests notice.

    pip install cosmic-ray coverage
    python scripts/proof/mutation_study.py physics --count 120 --seed 1
    python scripts/proof/mutation_study.py ident --count 120 --seed 1 --only spectra,cost

cosmic-ray's operators make the mutants: of a seeded sample of places in the sources, one that is
still Python; annotations, decorators and `TYPE_CHECKING` are left out. What .ci/run runs, slow
tests too, runs once under coverage, so that a mutant meets only tests that execute its line, the
restated laws and then the fastest first, until one fails. What never ends, in CPU time or in
waiting, counts as killed. The physics runs interpreted (tests/interpreted.py), so that kernel.py,
which compiles it, is left out. Everything happens in a copy of the checkout.

Prints the survivors as differences, then killed and tried of each module, and of all with the
Wilson interval of 95 %. The exit status is 1 if fewer than 85 % are killed.
"""

import argparse
import ast
import contextlib
import difflib
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
import tomllib
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from itertools import chain
from pathlib import Path

ROOT = Path(__file__).parents[2]
with open(Path(__file__).with_suffix(".toml"), "rb") as file:
    PLAN = tomllib.load(file)
FIRST = "restated"
"""In the name of tests that hold whole laws against a second statement of them: tried first."""
SKIPPED = ("core/NoOp", "core/VariableReplacer", "core/VariableInserter")
CPU_LIMIT = 30  # s of a mutant's tests beyond twice what they take by themselves
WAIT_LIMIT = 10  # times as long by the clock, on a machine with other work
BUDGET = 30.0  # s of tests for one mutant
KILLED = ("killed", "time")
LEAST = 0.85  # share of the mutants that is to be killed


@dataclass(frozen=True)
class Mutant:
    """One change of one file: an operator's name, which of its occurrences, and the line."""

    path: str
    operator: str
    occurrence: int
    line: int

    def source(self, root: Path) -> str | None:
        """Return the mutant's source; None if it is no Python, which would flatter the tests."""
        from cosmic_ray.mutating import mutate_code
        from cosmic_ray.plugins import get_operator

        source = (root / self.path).read_text(encoding="utf-8")
        changed = mutate_code(source, get_operator(self.operator)(), self.occurrence)
        with contextlib.suppress(SyntaxError):
            ast.parse(changed)
            return changed
        return None


def left_out(source: str) -> list[tuple[tuple[int, int], tuple[int, int]]]:
    """Return where no mutant could show: annotations, decorators and whether types are checked."""
    found: list[ast.expr | None] = []
    for node in ast.walk(ast.parse(source)):
        found.append(getattr(node, "annotation", None))
        found.append(getattr(node, "returns", None))
        found += getattr(node, "decorator_list", [])
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            found.append(node.test)
        if isinstance(node, ast.Subscript) and ast.unparse(node.value) == "Literal":
            found.append(node)
    return [((n.lineno, n.col_offset), (n.end_lineno, n.end_col_offset)) for n in found if n]


def mutants(path: Path, name: str) -> Iterator[tuple[object, Mutant]]:
    """Yield every mutant of a file, each with the place where it changes something."""
    from cosmic_ray.ast import ast_nodes, get_ast_from_path
    from cosmic_ray.plugins import get_operator, operator_names

    source = path.read_text(encoding="utf-8")
    lines, hidden = source.split("\n"), left_out(source)
    nodes = list(ast_nodes(get_ast_from_path(path)))
    for operator in operator_names():
        if operator in SKIPPED or get_operator(operator).arguments():
            continue
        changes = get_operator(operator)()
        positions = [at for node in nodes for at in changes.mutation_positions(node)]
        for occurrence, (start, end) in enumerate(positions):
            marker = lines[start[0] - 1][start[1] :].startswith("*,")  # keywords follow
            unseen = any(low <= start and end <= high for low, high in hidden)
            if not (marker or unseen or operator == "core/RemoveDecorator"):
                yield (name, start, end), Mutant(name, operator, occurrence, start[0])


def sample(files: list[Path], root: Path, count: int, seed: int) -> list[Mutant]:
    """Return one mutant of each of a number of places, sampled without replacement."""
    places = defaultdict(list)
    for path in files:
        for place, mutant in mutants(path, str(path.relative_to(root))):
            places[place].append(mutant)
    dice, chosen = random.Random(seed), []
    for place in dice.sample(sorted(places), len(places)):
        here = dice.sample(places[place], len(places[place]))
        chosen += [one for one in here if one.source(root) is not None][:1]
        if len(chosen) == count:
            break
    print(f"{len(chosen)} of {len(places)} places, {sum(map(len, places.values()))} mutants")
    return chosen


def in_child(work: Callable[[], int], cpu: float | None, log: Path) -> int:
    """Return the exit status of some work in a fork of this process; negative when killed."""
    child = os.fork()
    if child:
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    target = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(target, 1)
    os.dup2(target, 2)
    if cpu is not None:
        resource.setrlimit(resource.RLIMIT_CPU, (int(cpu) + 1, int(cpu) + 2))
        signal.alarm(WAIT_LIMIT * (int(cpu) + 1))
    try:
        status = work()
    except BaseException:
        status = 99
    os._exit(int(status))


class Baseline:
    """Which tests execute which lines, and how long each takes; a plugin of pytest's."""

    def __init__(self, root: Path, area: str) -> None:
        self.root, self.seconds, self.lines, self.started = root, {}, {}, 0.0
        if in_child(lambda: self._measure(area), None, root / "log.txt"):
            sys.exit(f"the tests fail without a mutant:\n{(root / 'log.txt').read_text()[-3000:]}")
        self.seconds, self.lines = json.loads((root / "baseline.json").read_text(encoding="utf-8"))

    def _measure(self, area: str) -> int:
        import coverage
        import pytest

        only = [f"*/helisim/{area}/*"]
        self.coverage = coverage.Coverage(data_file=None, include=only, config_file=False)
        self.coverage.start()
        for path in sorted((self.root / "src" / "helisim" / area).glob("[!_]*.py")):
            import_module(f"helisim.{area}.{path.stem}")  # what is imported later is no test's own
        options = ["-q", "-n0", "-m", "not study", *PLAN["tests"][area]]
        status = pytest.main(options, plugins=[self])
        self.coverage.stop()
        data = self.coverage.get_data()
        by = {str(Path(f).relative_to(self.root)): f for f in data.measured_files()}
        lines = {name: data.contexts_by_lineno(file) for name, file in by.items()}
        text = json.dumps([self.seconds, lines])
        (self.root / "baseline.json").write_text(text, encoding="utf-8")
        return int(status)

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        """Count what no test executes by itself as nobody's."""
        self.coverage.switch_context("")

    def pytest_runtest_call(self, item) -> None:
        self.coverage.switch_context(item.nodeid)
        self.started = time.process_time()

    def pytest_runtest_teardown(self, item) -> None:
        """End that, and keep how much CPU time it took."""
        self.seconds[item.nodeid] = time.process_time() - self.started
        self.coverage.switch_context("")

    def tests_of(self, mutant: Mutant) -> tuple[list[str], float]:
        """Return the tests that execute a mutant's line, fastest first, and their time together.

        A line that runs while a module is imported, or in a fixture, meets all tests.
        """
        contexts = self.lines.get(mutant.path, {}).get(str(mutant.line)) or [""]
        known = {one for one in self.seconds if "" in contexts or one in contexts}
        chosen, total = [], 0.0
        for _, seconds, test in sorted((FIRST not in one, self.seconds[one], one) for one in known):
            if total + seconds > BUDGET and chosen:
                break
            chosen.append(test)
            total += seconds
        return chosen, total


def tried(root: Path, mutant: Mutant, baseline: Baseline) -> tuple[str, str]:
    """Return what became of a mutant (killed, time, survived, unseen) and its difference."""
    path, name = root / mutant.path, mutant.path.removeprefix("src/helisim/")
    source, stamp = path.read_text(encoding="utf-8"), path.stat()
    mutated = mutant.source(root) or ""
    both = source.split("\n"), mutated.split("\n")
    difference = "\n".join(difflib.unified_diff(*both, name, name, "", "", 0, ""))
    tests, seconds = baseline.tests_of(mutant)

    def run() -> int:
        import pytest

        sys.dont_write_bytecode = True
        return int(pytest.main(["-xq", "-n0", "-pno:cacheprovider", "-m", "not study", *tests]))

    try:
        path.write_text(mutated, encoding="utf-8")
        status = in_child(run, CPU_LIMIT + 2.0 * seconds, root / "log.txt") if tests else 0
    finally:
        path.write_text(source, encoding="utf-8")
        os.utime(path, ns=(stamp.st_atime_ns, stamp.st_mtime_ns))
    word = "time" if status < 0 else "killed" if status else "survived" if tests else "unseen"
    return word, difference


def show(outcomes: dict[str, list[bool]]) -> list[bool]:
    """Print killed and tried of each module, and of all with the interval; return all of them."""
    from scipy.stats import binomtest

    every = list(chain.from_iterable(outcomes.values()))
    print(f"\n{'module':<28}{'killed':>8}{'tried':>8}")
    for one, dead in (*sorted(outcomes.items()), ("all", every)):
        print(f"{one:<28}{sum(dead):>8}{len(dead):>8}")
    if every:
        interval = binomtest(sum(every), len(every)).proportion_ci(method="wilson")
        found = (100.0 * one for one in (sum(every) / len(every), interval.low, interval.high))
        print("{:.1f} % (95 %: {:.1f} to {:.1f} %)".format(*found))
    return every


def main() -> int:
    """Print survivors and the table, of a copy of the checkout; return 1 below the least share."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("area", choices=PLAN["tests"])
    parser.add_argument("--count", type=int, default=120, help="places that are mutated")
    parser.add_argument("--seed", type=int, default=1, help="of the sample")
    parser.add_argument("--only", help="modules, separated by commas")
    options = parser.parse_args()
    if options.area == "physics":
        os.environ["NUMBA_DISABLE_JIT"] = "1"
    with tempfile.TemporaryDirectory(prefix="helisim-mutants-") as folder:
        root = Path(folder)
        for part in ("src", "tests", "models", "scripts"):
            shutil.copytree(ROOT / part, root / part, ignore=shutil.ignore_patterns("__pycache__"))
        shutil.copy(ROOT / "pyproject.toml", root)
        os.chdir(root)
        os.environ["PYTHONPATH"] = str(root / "src")
        sys.path.insert(0, str(root / "src"))
        for name in PLAN["libraries"]:
            import_module(name)
        files = sorted((root / "src" / "helisim" / options.area).rglob("*.py"))
        wanted = options.only.split(",") if options.only else {one.stem for one in files}
        files = [one for one in files if one.stem in wanted and one.stem != "kernel"]
        chosen = sample(files, root, options.count, options.seed)
        baseline = Baseline(root, options.area)
        print(f"{len(baseline.seconds)} tests, {sum(baseline.seconds.values()):.0f} s", flush=True)
        outcomes: dict[str, list[bool]] = defaultdict(list)
        for mutant in chosen:
            outcome, difference = tried(root, mutant, baseline)
            outcomes[mutant.path.removeprefix("src/helisim/")].append(outcome in KILLED)
            print(f"{outcome} {mutant.path}:{mutant.line}", file=sys.stderr, flush=True)
            if outcome not in KILLED:
                what = mutant.operator.removeprefix("core/")
                print(f"\n{outcome}: {what}\n{difference}", flush=True)
    killed = show(outcomes)
    return int(sum(killed) < LEAST * len(killed))


if __name__ == "__main__":
    sys.exit(main())
