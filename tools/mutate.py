"""Puts single errors into the package, one at a time: does a test notice?

    python -m tools.mutate --seed 7 --count 150 [--room core ...] [--work FOLDER] [--list]

Every place of the package where an operator below fits is a candidate. Places are drawn with the
seed, one file after the other and in each file one operator after the other, so that neither large
files nor frequent operators fill the sample; several rooms give one error each in turn. The fast
tests run once under coverage, which says which of them run each line. Each error then goes into a
copy of the checkout, in which the tests that run its line are done, those first that run the fewest
lines in all; then whole files: those that name its module, those of these tests, and those that
start processes, which coverage does not see. What is left goes into one copy all together, in which
every fast test runs; those that fail there are done with each error by itself. No real data is
used. Errors that no test notices are listed, with a diff each; the exit status is 1 if there are
more than 5 %. ``--work FOLDER`` keeps the coverage and the outcomes, so that a run goes on where it
was interrupted.
"""

from __future__ import annotations

import argparse
import ast
import difflib
import json
import multiprocessing
import os
import queue
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parent.parent
PACKAGE = "genie_sim"
MAX_SURVIVORS = 0.05
MAX_CPU_S = 20  # of one process that runs tests
MAX_MEMORY = 8 * 2**30  # bytes that it writes to; Chromium reserves far more
LONGEST_S, LONGEST_TEST_S = 900, 100
NOT_RUN = ("tests/docs",)
FAST = (
    *("-q", "-m", "not (slow or ros or data or nightly or alone)"),
    *(f"--ignore={folder}" for folder in NOT_RUN),
)
# Each process with tests begins as a copy of one that has these modules.
PROCESSES = multiprocessing.get_context("forkserver")
PRELOADED = ["pytest", "numpy", "pandas", "pyarrow.parquet", "hypothesis", "simpy"]
FAILED = re.compile(r"^(?:FAILED|ERROR) (\S+)", re.MULTILINE)
REAL_DATA = ("GENIE_SIM_KITTI", "GENIE_SIM_WEIGHTS")

OTHER_COMPARISON: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
}
OTHER_ARITHMETIC: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.FloorDiv,
}
OTHER_FUNCTION = {
    "min": "max",
    "max": "min",
    "any": "all",
    "all": "any",
    "floor": "ceil",
    "ceil": "floor",
    "sin": "cos",
    "cos": "sin",
    "argmin": "argmax",
    "argmax": "argmin",
}
# Functions of two arguments that may as well change places.
SYMMETRIC = ("min", "max", "hypot", "maximum", "minimum", "isclose", "gcd")
# Keywords that say what holds anyway: equal lengths (``zip``), private fields (``field``).
ASSERTED = ("strict", "compare", "repr")


@dataclass(frozen=True)
class Mutation:
    """One error: ``text`` instead of what stands from ``start`` to ``end`` (offsets in a file)."""

    file: str
    line: int
    last_line: int
    operator: str
    start: int
    end: int
    text: str

    def apply(self, source: str) -> str:
        """The file's source with the error in it."""
        return source[: self.start] + self.text + source[self.end :]


def candidates(file: str, source: str) -> Iterator[Mutation]:
    """Every place in a file where an operator fits."""
    starts = [0]
    for line in source.encode().splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    encoded = source.encode()

    def offset(line: int, column: int) -> int:
        return len(encoded[: starts[line - 1] + column].decode())

    tree = ast.parse(source)
    skipped = {inner for outer in ineffective(tree) for inner in ast.walk(outer)}
    for node in ast.walk(tree):
        if node in skipped:
            continue
        for operator, mutated in mutated_forms(node):
            assert isinstance(node, ast.expr | ast.stmt)
            assert node.end_lineno is not None and node.end_col_offset is not None
            start = offset(node.lineno, node.col_offset)
            end = offset(node.end_lineno, node.end_col_offset)
            # Parentheses keep an expression whole that goes over several lines.
            text = ast.unparse(mutated)
            text = f"({text})" if isinstance(node, ast.expr) else text
            yield Mutation(file, node.lineno, node.end_lineno, operator, start, end, text)


def ineffective(tree: ast.AST) -> Iterator[ast.AST]:
    """What decides nothing that a run shows: annotations, options of decorators, such as
    ``frozen``, those in ``ASSERTED``.
    """
    for node in ast.walk(tree):
        yield from getattr(node, "decorator_list", ())
        annotation = getattr(node, "annotation", None)
        if annotation is not None:
            yield annotation
        if isinstance(node, ast.keyword) and node.arg in ASSERTED:
            yield node.value


def mutated_forms(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """What may stand in the place of a node, each with the name of the operator."""
    if isinstance(node, ast.Compare) and type(node.ops[0]) in OTHER_COMPARISON:
        ops = [OTHER_COMPARISON[type(node.ops[0])](), *node.ops[1:]]
        yield "comparison", ast.Compare(node.left, ops, node.comparators)
    elif isinstance(node, ast.BinOp) and type(node.op) in OTHER_ARITHMETIC:
        if not any(is_text(side) for side in (node.left, node.right)):
            yield "arithmetic", ast.BinOp(node.left, OTHER_ARITHMETIC[type(node.op)](), node.right)
    elif isinstance(node, ast.BoolOp):
        other = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        yield "and/or", ast.BoolOp(other, node.values)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not | ast.USub):
        yield "sign", node.operand
    elif isinstance(node, ast.IfExp):
        yield "branches", ast.IfExp(node.test, node.orelse, node.body)
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        if isinstance(node.value, bool):
            yield "flag", ast.Constant(not node.value)
        else:
            # A nanosecond more in a second is no error that anybody could notice.
            yield "number", ast.Constant(node.value + 1 if abs(node.value) < 10 else 2 * node.value)
    elif isinstance(node, ast.Call):
        name = getattr(node.func, "id", getattr(node.func, "attr", ""))
        if name in OTHER_FUNCTION:
            function: ast.expr = ast.Name(OTHER_FUNCTION[name])
            if isinstance(node.func, ast.Attribute):
                function = ast.Attribute(node.func.value, OTHER_FUNCTION[name])
            yield "function", ast.Call(function, node.args, node.keywords)
        plain = [
            place
            for place, argument in enumerate(node.args)
            if not isinstance(argument, ast.Starred)
        ]
        is_symmetric = name in SYMMETRIC and len(node.args) == 2
        if len(plain) == len(node.args) >= 2 and not is_symmetric:
            yield (
                "order",
                ast.Call(node.func, [node.args[1], node.args[0], *node.args[2:]], node.keywords),
            )
        if any(keyword.arg == "key" for keyword in node.keywords):
            rest = [keyword for keyword in node.keywords if keyword.arg != "key"]
            yield "key", ast.Call(node.func, node.args, rest)
    elif isinstance(node, ast.AugAssign | ast.Raise) or (
        isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
    ):
        yield "left out", ast.Pass()
    elif isinstance(node, ast.Return) and isinstance(node.value, ast.Attribute | ast.Name):
        yield "nothing returned", ast.Return(ast.Constant(None))


def is_text(node: ast.expr) -> bool:
    """Whether an operand is text: another operator would fail at once."""
    return isinstance(node, ast.JoinedStr) or (
        isinstance(node, ast.Constant) and isinstance(node.value, str)
    )


def drawn_by_room(seed: int, count: int, rooms: Sequence[str]) -> list[Mutation]:
    """``count`` different errors, one of each room in turn."""
    turns = zip_longest(*(drawn(seed, count, room) for room in rooms))
    return [mutation for turn in turns for mutation in turn if mutation is not None][:count]


def drawn(seed: int, count: int, room: str | None) -> list[Mutation]:
    """``count`` different errors: files in turn, in each file operators in turn, places at
    random.
    """
    rng = random.Random(seed)
    strata: dict[str, dict[str, list[Mutation]]] = {}
    for path in sorted((REPOSITORY / PACKAGE / (room or "")).rglob("*.py")):
        file = path.relative_to(REPOSITORY).as_posix()
        by_operator: defaultdict[str, list[Mutation]] = defaultdict(list)
        for mutation in candidates(file, path.read_text(encoding="utf-8")):
            by_operator[mutation.operator].append(mutation)
        if by_operator:
            strata[file] = dict(by_operator)
    sample: list[Mutation] = []
    while strata and len(sample) < count:
        files = rng.sample(sorted(strata), len(strata))
        for file in files[: count - len(sample)]:
            operator = rng.choice(sorted(strata[file]))
            places = strata[file][operator]
            sample.append(places.pop(rng.randrange(len(places))))
            if not places:
                del strata[file][operator]
            if not strata[file]:
                del strata[file]
    return sample


class Cover:
    """Which tests run which line. ``folder`` is where the coverage of the fast tests is, or comes
    to be, measured in a ``copy`` of the checkout.
    """

    def __init__(self, folder: Path, copy: Path) -> None:
        from coverage import CoverageData

        if not list(folder.glob("coverage.db*")):
            self._measure(folder, copy)
        self._tests: defaultdict[str, defaultdict[int, set[str]]]
        self._tests = defaultdict(lambda: defaultdict(set))  # by file and line
        self._lines: Counter[str] = Counter()  # how many a test runs
        for database in sorted(folder.glob("coverage.db*")):
            data = CoverageData(str(database))
            data.read()
            for path in data.measured_files():
                file = PACKAGE + path.rpartition(PACKAGE)[2]
                for line, contexts in data.contexts_by_lineno(path).items():
                    tests = {context.rpartition("|")[0] for context in contexts} - {""}
                    self._tests[file][line] |= tests
                    self._lines.update(tests)
        self._texts = {
            path.relative_to(REPOSITORY).as_posix(): path.read_text(encoding="utf-8")
            for path in (REPOSITORY / "tests").rglob("test_*.py")
        }
        self._texts = {
            name: text for name, text in self._texts.items() if not name.startswith(NOT_RUN)
        }

    @staticmethod
    def _measure(folder: Path, copy: Path) -> None:
        settings = folder / "coverage.ini"
        settings.write_text(f"[run]\nsource = {PACKAGE}\ndata_file = {folder}/coverage.db\n")
        options = ("--cov", f"--cov-config={settings}", "--cov-context=test", "--cov-report=")
        pytest = [sys.executable, "-m", "pytest", *FAST, *options, "tests"]
        if subprocess.run(pytest, cwd=copy, env=environment(copy)).returncode != 0:
            raise SystemExit("the tests fail without any error in the package")

    def tests(self, mutation: Mutation) -> list[str]:
        """The tests that run an error's lines; of a line that runs at import, those of its file."""
        of_lines = self._tests[mutation.file]
        lines = range(mutation.line, mutation.last_line + 1)
        names = set().union(*(of_lines.get(line, set()) for line in lines))
        names = names or set().union(*of_lines.values())
        return sorted(names, key=lambda name: (self._lines[name], name))

    def files(self, mutation: Mutation) -> list[str]:
        """Files that name an error's module, whose tests run its file, or that start processes."""
        module = mutation.file.removesuffix("/__init__.py").removesuffix(".py").replace("/", ".")
        parent, _, stem = module.rpartition(".")
        named = re.compile(rf"{module}\b|from {parent} import .*\b{stem}\b")
        naming = [name for name, text in self._texts.items() if named.search(text)]
        naming.sort(key=lambda name: (stem not in name, len(self._texts[name])))
        names = set().union(*self._tests[mutation.file].values())
        running = sorted({name.partition("::")[0] for name in names})
        starting = [name for name, text in self._texts.items() if "run_cli" in text]
        return list(dict.fromkeys([*naming, *running, *sorted(starting)]))


def copy_to(folder: Path) -> None:
    """Copies the files of the checkout that git does not ignore: what is missing in a copy would
    make tests fail there that notice nothing.
    """
    git = ("git", "ls-files", "-z", "--cached", "--others", "--exclude-standard")
    listed = subprocess.run(git, cwd=REPOSITORY, capture_output=True, text=True, check=True)
    for name in listed.stdout.split("\0"):
        path = REPOSITORY / name
        if path.is_file():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(path, folder / name)


@contextmanager
def broken(copy: Path, mutations: Sequence[Mutation]) -> Iterator[None]:
    """A copy has these errors meanwhile; of two that overlap one."""
    with ExitStack() as stack:
        for file in {mutation.file for mutation in mutations}:
            path = copy / file
            status, whole = path.stat(), path.read_text(encoding="utf-8")
            # its byte code is right again afterwards
            times = status.st_atime_ns, status.st_mtime_ns
            stack.callback(os.utime, path, ns=times)
            stack.callback(path.write_text, whole, encoding="utf-8")
            source, begin = whole, len(whole)
            for mutation in sorted(mutations, key=lambda one: -one.start):
                if mutation.file == file and mutation.end <= begin:
                    source, begin = mutation.apply(source), mutation.start
            path.write_text(source, encoding="utf-8")
        yield


def noticed_by(mutation: Mutation, copy: Path, cover: Cover) -> str | None:
    """The first test that fails in a copy with this error, or ``None``."""
    with broken(copy, [mutation]):
        for tests in (cover.tests(mutation), cover.files(mutation)):
            failed = failing_test(copy, tests)
            if failed is not None:
                return failed
    return None


def noticed_together(mutations: Sequence[Mutation], copy: Path) -> list[str]:
    """The fast tests that fail in a copy with all these errors."""
    # an error may end in an endless loop
    options = ("--tb=no", "-rfE", f"--timeout={MAX_CPU_S}", "-p", "no:cacheprovider")
    with broken(copy, mutations):
        ran = subprocess.run(
            [sys.executable, "-m", "pytest", *FAST, *options, "tests"],
            cwd=copy,
            env=environment(copy),
            capture_output=True,
            text=True,
        )
    return FAILED.findall(ran.stdout)


def unnoticed(mutations: Sequence[Mutation], copy: Path) -> list[Mutation]:
    """Those that no fast test notices. All of them go into a copy together; each test that then
    fails is done with each of them by itself.
    """
    tests, left = noticed_together(mutations, copy) if mutations else [], []
    for mutation in mutations:
        with broken(copy, [mutation]):
            failed = failing_test(copy, tests)
        print(f"{mutation.file}:{mutation.line} {failed or 'SURVIVED'}", flush=True)
        if failed is None:
            left.append(mutation)
    return left


def failing_test(copy: Path, tests: list[str]) -> str | None:
    """The first of these tests that fails in a copied checkout within ``MAX_CPU_S``."""
    if not tests:
        return None
    (copy / "tests.txt").write_text("\n".join(tests) + "\n", encoding="utf-8")
    process = PROCESSES.Process(target=run_tests, args=(copy,))
    process.start()
    process.join(LONGEST_S)
    process.kill()
    output = (copy / "output.txt").read_text(encoding="utf-8", errors="replace")
    failed = [line for line in output.splitlines() if line.startswith(("FAILED ", "ERROR "))]
    if failed:
        return failed[0]
    if process.exitcode in (0, 5, -signal.SIGXCPU, -signal.SIGKILL):  # 5: none was collected
        return None
    return f"exit status {process.exitcode}"


def run_tests(copy: Path) -> None:
    """In a process of its own: pytest in a copied checkout, up to the first failure."""
    resource.setrlimit(resource.RLIMIT_CPU, (MAX_CPU_S, MAX_CPU_S + 5))
    resource.setrlimit(resource.RLIMIT_DATA, (MAX_MEMORY, MAX_MEMORY))
    for name in [name for name in sys.modules if name.partition(".")[0] in (PACKAGE, "tests")]:
        del sys.modules[name]
    sys.path[:0] = [str(copy)]
    sys.dont_write_bytecode = True
    os.chdir(copy)
    os.environ.update(PYTHONPATH=str(copy), PYTHONDONTWRITEBYTECODE="1")
    for name in REAL_DATA:
        os.environ.pop(name, None)
    output = os.open("output.txt", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(output, 1)
    os.dup2(output, 2)
    import pytest
    from hypothesis import Phase, settings

    # The first example that fails is enough; to make it smaller would take the whole time.
    phases = (Phase.explicit, Phase.generate)
    settings.register_profile(
        "no_shrinking", derandomize=True, deadline=None, max_examples=50, phases=phases
    )
    options = ["-x", "-rfE", "--tb=line", f"--timeout={LONGEST_TEST_S}", "@tests.txt"]
    options.append("--hypothesis-profile=no_shrinking")
    status = pytest.main([*FAST, "-n", "0", "-p", "no:cacheprovider", *options])
    os._exit(status)  # at once: workers that a test left running would be waited for


def environment(copy: Path) -> dict[str, str]:
    """This process's variables without those of real data, for Python in a copy."""
    kept = {name: value for name, value in os.environ.items() if name not in REAL_DATA}
    return {**kept, "PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"}


def mutate(sample: list[Mutation], work: Path, jobs: int) -> list[Mutation]:
    """Tries each error, prints and keeps what became of it; returns those that nobody noticed."""
    outcomes = work / "outcomes.jsonl"
    known: dict[str, str | None] = {}
    if outcomes.exists():
        lines = outcomes.read_text(encoding="utf-8").splitlines()
        known = {line["error"]: line["noticed_by"] for line in map(json.loads, lines)}
    copies: queue.SimpleQueue[Path] = queue.SimpleQueue()
    with ExitStack() as stack:
        for _ in range(jobs):
            copy = Path(stack.enter_context(tempfile.TemporaryDirectory()))
            copy_to(copy)
            copies.put(copy)
        cover = Cover(work, copy)

        def outcome(mutation: Mutation) -> str | None:
            if report(mutation) not in known:
                copy = copies.get()
                try:
                    known[report(mutation)] = noticed_by(mutation, copy, cover)
                finally:
                    copies.put(copy)
                line = {"error": report(mutation), "noticed_by": known[report(mutation)]}
                with outcomes.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(line) + "\n")
            return known[report(mutation)]

        with ThreadPoolExecutor(jobs) as pool:
            tried = zip(sample, pool.map(outcome, sample), strict=True)
            for number, (mutation, by) in enumerate(tried, 1):
                word = "SURVIVED" if by is None else "caught"
                place = f"{mutation.file}:{mutation.line}"
                print(f"{number}/{len(sample)} {word} {place} {by or ''}", flush=True)
        left = [mutation for mutation in sample if known[report(mutation)] is None]
        return unnoticed(left, copies.get())


def report(mutation: Mutation) -> str:
    """An error as a diff."""
    source = (REPOSITORY / mutation.file).read_text(encoding="utf-8")
    lines = source.splitlines(), mutation.apply(source).splitlines()
    diff = list(difflib.unified_diff(*lines, n=0, lineterm=""))[2:]
    return "\n    ".join([f"{mutation.file}:{mutation.line}: {mutation.operator}", *diff])


def main() -> int:
    """Runs the tool; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tools.mutate", description=__doc__)
    parser.add_argument("--seed", type=int, default=1, help="of the draw")
    parser.add_argument("--count", type=int, default=150, help="how many errors")
    parser.add_argument(
        "--room", nargs="+", default=[""], help="folders of the package, in turn: core sim/cars"
    )
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="copies at a time")
    parser.add_argument("--work", type=Path, help="a folder for the coverage and the outcomes")
    parser.add_argument("--list", action="store_true", help="show the errors and stop")
    options = parser.parse_args()
    PROCESSES.set_forkserver_preload(PRELOADED)
    sample = drawn_by_room(options.seed, options.count, options.room)
    if options.list:
        print("\n".join(map(report, sample)))
        return 0
    with tempfile.TemporaryDirectory() as folder:
        work = options.work or Path(folder)
        work.mkdir(parents=True, exist_ok=True)
        survivors = mutate(sample, work.resolve(), options.jobs)
    caught = len(sample) - len(survivors)
    print(f"\nseed {options.seed}: {caught} of {len(sample)} caught ({caught / len(sample):.0%})")
    print("\n".join(map(report, survivors)))
    return int(len(survivors) > MAX_SURVIVORS * len(sample))


if __name__ == "__main__":
    sys.exit(main())
