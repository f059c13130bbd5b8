"""Methods on the command line, code of one's own that a run announces, and what ``list`` knows of
plug-ins.
"""

from __future__ import annotations

import itertools
import json
import os
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import pytest

import genie_sim as gs
from genie_sim.base import plugins
from genie_sim.base.errors import UserError
from genie_sim.base.settings import plain_data
from genie_sim.cli import catalogue
from genie_sim.cli.main import app, main
from genie_sim.runs.folder import run_to_folder
from genie_sim.scenario.reading import load_scenario
from genie_sim.sim.method import METHODS
from genie_sim.study.design import design_of
from genie_sim.study.study import Study
from genie_sim.study.work import Parts
from tests.checkout import REPOSITORY, CommandLine, sign
from tests.kitti_folder import make_drive

SCENARIO = """
description: Three methods, one with settings of its own.
edges: [{name: edge1, device: agx_xavier}]
cars: [{name: car1, device: jetson_tx2, edge: edge1, route: {window: [0 s, 1 s]}}]
methods:
  - local
  - {name: tiny, method: genie, genie: {eviction: lru, capacity: 3 entries}}
  - {name: mine, method: "mod:Nothing", share: 3}
"""
SHORT = {
    "cars[0].route.window": ["0 s", "1 s"],
    "methods": ["genie"],
    "genie.capacity": "2 entries",
}
OWN = """
from genie_sim.methods.local import Local


class Nothing(Local):
    title = "as local"

    def __init__(self, share=1):
        self.share = share
"""


def test_what_one_command_allows_is_no_affair_of_the_next():
    with plugins.own_code_allowed(allowed=False):
        assert main(["rerun", "nothing", "--allow-own-code"]) == 1
        assert not plugins.is_own_code_allowed()


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    (tmp_path / "mod.py").write_text(OWN)
    (tmp_path / "mine.yaml").write_text(SCENARIO)
    return tmp_path / "mine.yaml"


def test_methods_are_chosen_among_the_scenarios_own_and_all_others(mine: Path):
    setting = load_scenario(mine)
    chosen = load_scenario(mine, methods=["remote", "mine", "tiny", "my.module:Other"])
    assert [entry.name for entry in chosen.methods] == ["remote", "mine", "tiny", "Other"]
    assert chosen.methods[1:3] == (
        setting.methods[2],
        setting.methods[1],
    ), "with their own settings"
    assert chosen.method_settings[chosen.methods[2].name].genie.capacity.entries == 3
    others = [plain_data(replace(one, methods=())) for one in (chosen, setting)]
    assert others[0] == others[1], "nothing else changes"


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (
            ["loca"],
            r"^--methods x: unknown method 'loca' \(did you mean 'local'\?\).* mine,",
        ),
        (["local", ""], r"^--methods x: unknown method ''"),
        ([" local"], r"^--methods x: unknown method ' local' \(did you mean 'local'\?\)"),
        (["local", "local"], r"^--methods x: duplicate name 'local'$"),
    ],
)
def test_a_method_that_nobody_knows_is_one_line(mine: Path, names: list[str], message: str):
    with pytest.raises(UserError, match=message):
        load_scenario(mine, methods=names, methods_from="--methods x")


def test_run_takes_methods_and_says_first_that_code_of_ones_own_runs(
    mine: Path, run_cli: CommandLine, tmp_path: Path
):
    ran = run_cli("run", "mine.yaml", "--methods", "mine,remote", "--no-report")
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.splitlines()[0] == "mine runs code of its own: method mod:Nothing"
    (folder,) = (tmp_path / "results").iterdir()
    facts = json.loads((folder / "run.json").read_text())["facts"]
    assert facts["methods"] == [
        {"name": "mine", "title": "mine", "baseline": True},
        {"name": "remote", "title": "remote (R)", "baseline": True},
    ]
    assert list(facts["plugins"]) == ["method mod:Nothing"]

    shipped = run_cli("run", "mine.yaml", "--methods", "tiny,local", "--no-report")
    assert shipped.returncode == 0 and "of its own" not in shipped.stdout
    own = run_cli(
        "run",
        "mine.yaml",
        "--methods",
        "mod:Nothing",
        "--no-report",
        "--set",
        "genie.eviction=mod:Keep",
    )
    assert own.stdout == "mine runs code of its own: eviction mod:Keep, method mod:Nothing\n", (
        "before it is run"
    )
    assert own.stderr == "genie-sim: eviction 'mod:Keep': module 'mod' has no attribute 'Keep'\n"
    assert own.returncode == 1
    wrong = run_cli("run", "mine.yaml", "--methods", "tiny,loca")
    assert wrong.returncode == 1 and wrong.stderr.count("\n") == 1
    assert wrong.stderr.startswith(
        "genie-sim: --methods tiny,loca: unknown method 'loca' (did you mean 'local'?)"
    )


@pytest.mark.parametrize(
    ("kind", "names"),
    [
        ("methods", list(METHODS)),
        (
            "faults",
            [
                "outage",
                "hand_over",
                "crash",
                "stall",
                "slow",
                "partition",
                "gnss",
                "camera",
            ],
        ),
        ("sources", ["recorded", "town", "traffic"]),
        ("link-models", ["wire", "trace", "cell"]),
    ],
)
def test_plugins_are_listed_each_with_a_sentence(kind: str, names: list[str], run_cli: CommandLine):
    listed = run_cli("list", kind)
    assert listed.returncode == 0, listed.stderr
    lines = [line.split(maxsplit=1) for line in listed.stdout.splitlines()]
    assert [name for name, _ in lines] == names
    assert all(about[0].isupper() and about.rstrip().endswith(".") for _, about in lines)


def test_list_says_what_can_be_listed(run_cli: CommandLine):
    wrong = run_cli("list", "method")
    assert (
        wrong.returncode == 1
        and "unknown kind of thing to list 'method' (did you mean 'methods'?)" in wrong.stderr
    )
    kinds = [line.split()[:2] for line in run_cli("list").stdout.splitlines()]
    assert kinds == [[kind, f"{len([*names()])}:"] for kind, names in catalogue.KINDS.items()]


@pytest.mark.parametrize(
    ("setting", "line"),
    [
        (
            "methods=['raising:Method']",
            "method 'raising:Method': RuntimeError: 'why' (raising.py, line 6, in on_car",
        ),
        (
            "genie.eviction=raising:Keep",
            "eviction 'raising:Keep': KeyError: \"'why'\" (raising.py, line 12, in stored",
        ),
    ],
)
def test_code_of_ones_own_that_raises_is_one_line_and_debug_shows_where(
    tmp_path: Path, setting: str, line: str, capsys: pytest.CaptureFixture[str]
):
    (tmp_path / "raising.py").write_text(RAISING)
    command = [
        "run",
        "street_1car_homo",
        "--no-report",
        "--set",
        "cars[0].route.window=[0 s, 1 s]",
        "--set",
        setting,
    ]
    assert main(command) == 1
    assert capsys.readouterr().err == f"genie-sim: {line}); genie-sim --debug shows more\n"
    with pytest.raises((RuntimeError, KeyError), match="why"):
        main(["--debug", *command])
    assert not list(tmp_path.glob("results/*"))


STRANGE = {  # what a hook raises, and what the line tells of it
    "open('w.bin')": "FileNotFoundError: \"[Errno 2] No such file or directory: 'w.bin'\"",
    "raise BrokenPipeError": "BrokenPipeError: ''",
    "raise EOFError": "EOFError: ''",
    "raise SystemExit(3)": "SystemExit: '3'",
    "raise MemoryError": "MemoryError: ''",
    "raise GeneratorExit": "GeneratorExit: ''",
    "raise RecursionError": "RecursionError: ''",
    "raise type('E', (Exception,), {'__str__': None})": "E: 'its text fails with TypeError'",
}


@pytest.mark.parametrize(
    ("raised", "hook"),
    [*zip(STRANGE, itertools.cycle(["__init__", "stored"]))],
)
def test_whatever_code_of_ones_own_raises_is_told_as_its_own(
    tmp_path: Path, raised: str, hook: str, capsys: pytest.CaptureFixture[str]
):
    """What the machine, click and Python raise for reasons of theirs, too."""
    text = RAISING.replace(
        "def stored(self, *_)", f"stored = used\n    def {hook}(self, *_, **more)"
    )
    (tmp_path / "strange.py").write_text(text.replace('raise KeyError("why")', raised))
    sys.modules.pop("strange", None)
    short = ["--no-report", "--set", "cars[0].route.window=[0 s, 1 s]", "--methods", "genie"]
    assert main(["run", "street_1car_homo", *short, "--set", "genie.eviction=strange:Keep"]) == 1
    line = f"eviction 'strange:Keep': {STRANGE[raised]} (strange.py, line "
    assert capsys.readouterr().err.startswith(f"genie-sim: {line}")
    assert not list(tmp_path.glob("results/*"))
    with pytest.raises(UserError) as error:
        gs.run("street_1car_homo", {**SHORT, "genie.eviction": "strange:Keep"}, out="results")
    assert str(error.value).startswith(line) and not list(tmp_path.glob("results/*"))


def test_what_code_of_ones_own_changes_in_the_process_changes_no_result(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """It goes to another folder, prints, and seeds the random numbers of everybody."""
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "restless.py").write_text(RESTLESS)
    sys.modules.pop("restless", None)
    monkeypatch.syspath_prepend(tmp_path)
    quiet, restless = (
        gs.run("street_1car_homo", {**SHORT, "genie.eviction": name}, out="results", report=False)
        for name in ("lru", "restless:Keep")
    )
    assert Path.cwd() == tmp_path and not list((tmp_path / "elsewhere").iterdir())
    assert restless.folder and (tmp_path / restless.folder / "summary.md").is_file()
    assert restless.metrics.equals(quiet.metrics)


def test_what_cannot_be_shown_is_named_by_its_class(tmp_path: Path):
    (tmp_path / "unknown.py").write_text(UNKNOWN)
    sys.modules.pop("unknown", None)
    with pytest.raises(UserError) as error:
        gs.run("street_1car_homo", {**SHORT, "genie.eviction": "unknown:Keep"})
    shown = "<Unspeakable, whose repr() raises ValueError>"
    assert str(error.value).startswith(f"eviction unknown:Keep: victim() is {shown}, but must be")


def test_a_module_that_asks_for_an_end_is_taken_for_ctrl_c(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    (tmp_path / "stops.py").write_text(RAISING.replace('KeyError("why")', "KeyboardInterrupt"))
    sys.modules.pop("stops", None)
    line = ["run", "street_1car_homo", "--set", "genie.eviction=stops:Keep"]
    assert main([*line, "--set", "cars[0].route.window=[0 s, 1 s]"]) == 130
    assert capsys.readouterr().err == "genie-sim: interrupted; nothing was written\n"
    assert not list(tmp_path.glob("results/*"))


def test_what_a_module_raises_as_it_is_imported_is_told_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    (tmp_path / "raises.py").write_text("import nowhere_at_all\n")
    assert main(["run", "street_1car_homo", "--set", "genie.eviction=raises:Keep"]) == 1
    line = capsys.readouterr().err
    assert line.count("eviction 'raises:Keep'") == 1 and "(raises.py, line 1" in line


def test_a_class_of_ones_own_is_named_from_another_process(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
):
    line = ["run", "street_1car_homo", "--no-report", "--seeds", "2", "--jobs", "2"]
    line += ["--set", "cars[0].route.window=[0 s, 1 s]"]
    assert main(line) == 0, "the processes stay, and run in another folder next"
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    Path("raising.py").write_text(RAISING)
    line += ["--set", "genie.eviction=raising:Keep"]
    assert main(line) == 1
    assert "eviction 'raising:Keep': KeyError: \"'why'\" (raising.py" in capsys.readouterr().err


RAISING = """
from genie_sim.methods.local import Local

class Method(Local):
    def on_car(self, place):
        raise RuntimeError("why")

class Keep:
    def used(self, *_): ...
    removed = victim = expires_ns = used
    def stored(self, *_):
        raise KeyError("why")
"""

RESTLESS = """
import os
import random

import numpy as np
from genie_sim.core.eviction import LRU

os.chdir("elsewhere")


class Keep(LRU):
    def __init__(self):
        os.chdir("/")
        super().__init__()

    def stored(self, key, now_ns):
        os.chdir("/")
        print("stored")
        random.seed(now_ns)
        np.random.seed(now_ns % 2**32)
        super().stored(key, now_ns)
"""
UNKNOWN = """
from genie_sim.core.eviction import LRU


class Unspeakable:
    def __repr__(self):
        raise ValueError


class Keep(LRU):
    def victim(self):
        return Unspeakable()
"""


# Folders from elsewhere

TRAP = "open('sprung', 'w').close()\n"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The result folder of a run with a class of somebody's own."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "mod.py").write_text(OWN)
    (folder / "mine.yaml").write_text(SCENARIO)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        methods = "methods=[local, {name: mine, method: 'mod:Nothing'}]"
        result = run_to_folder(load_scenario(folder / "mine.yaml", [methods]), folder)
    sys.modules.pop("mod")
    return result.folder


@pytest.fixture
def from_elsewhere(made: Path, tmp_path: Path) -> Path:
    """The same, where a module of that name lies that nobody should import."""
    (tmp_path / "mod.py").write_text(TRAP + OWN)
    sys.modules.pop("mod", None)  # other tests have classes of their own, too
    return Path(shutil.copytree(made, tmp_path / "moved"))


@pytest.mark.slow
def test_a_folder_from_elsewhere_imports_nothing_unless_it_is_allowed(
    from_elsewhere: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    folder = str(from_elsewhere)
    for command in (
        ["report", folder],
        ["compare", folder],
        ["figures", folder],
    ):
        assert main(command) == 0, command
    assert main(["rerun", folder]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert (
        line
        == "genie-sim: method 'mod:Nothing': is code of its own; pass --allow-own-code to run it"
    )
    assert not (tmp_path / "sprung").exists()
    (tmp_path / "mod.py").write_text(OWN)
    assert main(["rerun", folder, "--allow-own-code"]) == 0
    sys.modules.pop("mod")
    assert main(["rerun", folder]) == 1, "allowed for one command only"
    assert plugins.resolve("method", "mod:Nothing", {}), "and refused for one only"


def test_of_two_classes_in_one_module_the_one_that_fails_is_named(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
):
    """Whichever was named last, and also where a function beside them fails."""
    go = "    def go(self):\n        fail()\n\n\n"
    (tmp_path / "pair.py").write_text(
        f"class A:\n{go}class B:\n{go}def fail():\n    raise KeyError\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    first, second = (plugins.resolve("fault", f"pair:{name}", {}) for name in "AB")
    for cls in (first, second):
        with (
            pytest.raises(UserError, match=rf"^fault 'pair:{cls.__name__}': .*in fail\)$"),
            plugins.own_faults_told(),
        ):
            cls().go()
    with pytest.raises(UserError, match=r"^fault 'pair:A' or fault 'pair:B': "):
        plugins.call("fault", "pair:B", sys.modules["pair"].fail)


def test_a_command_that_says_nothing_of_it_imports_no_own_code(
    from_elsewhere: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    peek = click.Command("peek", callback=lambda: gs.load(from_elsewhere).scenario.new_methods())
    monkeypatch.setitem(app.commands, "peek", peek)
    assert main(["peek"]) == 1
    assert "pass --allow-own-code" in capsys.readouterr().err
    assert not Path("sprung").exists()


@pytest.mark.process
def test_workers_import_own_code_only_where_it_is_allowed(mine: Path, tmp_path: Path):
    scenario = load_scenario(mine, methods=["mine"])
    runs = [*Study.of(design_of(scenario, 2), "mine", tmp_path, base=scenario).plan.runs.values()]
    with (
        plugins.own_code_allowed(allowed=False),
        pytest.raises(UserError, match=r"2 of 2 runs failed.* pass --allow-own-code"),
    ):
        Parts(tmp_path).run(runs, 2)
    Parts(tmp_path).run(runs, 2)


@pytest.mark.process
def test_a_command_inside_a_folder_from_elsewhere_imports_nothing_of_it(from_elsewhere: Path):
    """Where Python itself would look first, and matplotlib for its settings."""
    # needed, needed later, looked for by pandas
    for module in ("mod", "simpy", "pandas", "numexpr"):
        (from_elsewhere / f"{module}.py").write_text(TRAP)
    (from_elsewhere / "matplotlibrc").write_text("backend: module://own\n")
    for command, status in (("report", 0), ("rerun", 1)):
        inside = subprocess.run(
            [sys.executable, "-m", "genie_sim", command, "."],
            cwd=from_elsewhere,
            capture_output=True,
            text=True,
            env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        )
        assert inside.returncode == status and inside.stderr.count("\n") == status, inside.stderr
    assert "pass --allow-own-code" in inside.stderr
    assert not (from_elsewhere / "sprung").exists()


OWN_CLASS = "trap:Nothing"


@pytest.mark.parametrize(
    "changes",
    [
        {"methods": [OWN_CLASS]},
        {"methods": [{"name": "x", "method": OWN_CLASS}]},
        {"methods": [{"name": "x", "method": "genie", "genie": {"eviction": OWN_CLASS}}]},
        {"genie": {"eviction": OWN_CLASS}},
        {"genie": {"similarity": OWN_CLASS}},
        {"genie": {"object_map": {"rule": OWN_CLASS}}},
        {"perception": {"source": OWN_CLASS}},
        {"edge_network": OWN_CLASS},
        {"cars": [{"name": "car1", "device": "jetson_tx2", "edge": "edge1", "link": OWN_CLASS}]},
        {"faults": [{"fault": OWN_CLASS, "target": "car1", "begin": "0 s", "end": "1 s"}]},
    ],
    ids=str,
)
def test_wherever_a_folder_names_a_class_it_is_not_imported(
    made: Path, tmp_path: Path, changes: dict[str, Any], capsys: pytest.CaptureFixture[str]
):
    (tmp_path / "trap.py").write_text(TRAP + OWN)
    make_drive(tmp_path / "kitti")
    said = json.loads((made / "run.json").read_text())
    said["facts"]["scenario"] |= {"methods": ["local", "genie"]} | changes
    shutil.copytree(made, tmp_path / "folder")
    (tmp_path / "folder" / "run.json").write_text(json.dumps(said))
    sign(tmp_path / "folder")
    assert main(["rerun", "folder"]) == 1
    assert not (tmp_path / "sprung").exists()
    assert "pass --allow-own-code" in capsys.readouterr().err


@pytest.mark.process
@pytest.mark.parametrize("said", ["'no licence'", "0"])
@pytest.mark.parametrize("where", ["", "    def __init__(self):\n        "])
def test_own_code_that_ends_the_program_is_named_with_status_1(where, said, tmp_path):
    (tmp_path / "quits.py").write_text(
        "import sys\nfrom genie_sim.methods.local import Local\n\n"
        "class Quits(Local):\n    title = 'quits'\n"
        + (where or f"sys.exit({said})\n")
        + (f"sys.exit({said})\n" if where else "")
    )
    ended = subprocess.run(
        [sys.executable, "-m", "genie_sim", "run", "street_1car_homo", "--methods", "quits:Quits"],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ended.returncode == 1
    last = ended.stderr.splitlines()[-1]
    text = repr(said.strip("'"))
    assert f"method 'quits:Quits': SystemExit: {text} (quits.py, line " in last
    assert ended.stderr.count("\n") == 1


def test_a_user_error_of_ones_own_class_names_it_once(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    refuses = "\n    def __init__(self):\n        raise UserError('not today')\n"
    head = "from genie_sim import UserError\nfrom genie_sim.methods.local import Local\n"
    (tmp_path / "refusing.py").write_text(f"{head}class Mine(Local):{refuses}")
    monkeypatch.syspath_prepend(tmp_path)
    assert main(["run", "street_1car_homo", "--methods", "refusing:Mine"]) == 1
    assert "methods[0]: method 'refusing:Mine': not today; " in capsys.readouterr().err


def test_a_module_is_named_without_its_suffix(capsys):
    assert main(["run", "street_1car_hetero", "--methods", "skip.py:Skip"]) == 1
    assert "a module is named without .py: skip:Skip" in capsys.readouterr().err


def test_a_check_counts_only_for_the_methods_that_are_chosen():
    """No request waits for an answer where no Genie runs."""
    overrides = ["genie.request_expiry=1us"]
    with pytest.raises(UserError, match="request_expiry"):
        load_scenario("street_1car_homo", overrides)
    assert load_scenario("street_1car_homo", overrides, methods=["local", "remote"])
