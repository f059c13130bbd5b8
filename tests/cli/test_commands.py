"""The command line as its user meets it: what it prints, what it writes, and what it says when
something is wrong.
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from genie_sim.cli.main import main
from tests.checkout import REPOSITORY, copied, sign

GOOD = """
methods: [genie]
cars:
  - {name: car1, device: jetson_tx2, edge: edge1, route: {window: [0 s, 1 s]}}
edges:
  - {name: edge1, device: agx_xavier}
"""

# The settings of a scenario are those of tests/scenario/test_mistakes.py.
BAD = [
    ("jetson_tx2", "jetson_tx3", "s.yaml: cars[0].device: unknown device 'jetson_tx3'"),
    ("[0 s, 1 s]", "[90 s, 91 s]", "cars[0].route.window: no camera takes a frame in it"),
    ("[0 s, 1 s]", "[9 s, 19 s]", "cars[0].route.window: ends at 19 s, after the last frame"),
    ("[0 s, 1 s]", "[10 ms, 20 ms]", "cars[0].route.window: no camera takes a frame in it"),
    ("\nmethods", "\ncameras: [{name: a, recording: '07'}]\nmethods", "cameras[0].recording: unk"),
]


@pytest.mark.parametrize(("right", "wrong", "message"), BAD)
def test_a_mistake_in_a_scenario_gets_one_line_and_status_1(right, wrong, message, capsys):
    Path("s.yaml").write_text(GOOD.replace(right, wrong, 1))
    assert main(["run", "s.yaml"]) == 1
    _one_line(capsys, message)
    assert not Path("results").exists()


@pytest.mark.parametrize("content", [b"", b"not parquet", None])
def test_a_broken_trace_is_named(content, capsys):
    path = Path("broken.parquet")
    whole = (REPOSITORY / "scenarios/traces/kitti_0005.parquet").read_bytes()
    path.write_bytes(whole[: len(whole) // 2] if content is None else content)
    Path("s.yaml").write_text(GOOD + "perception: {trace: ./broken.parquet}\n")
    assert main(["run", "s.yaml"]) == 1
    _one_line(capsys, "broken.parquet: ")


def test_an_unwritable_results_folder_is_found_before_simulating(capsys):
    Path("s.yaml").write_text(GOOD)
    Path("results").write_text("a file, not a folder")
    assert main(["run", "s.yaml"]) == 1
    _one_line(capsys, "results")


def test_usage_errors_have_status_2(capsys):
    assert main(["run"]) == 2
    assert main(["fly"]) == 2


def test_a_folder_that_is_no_result_cannot_be_rerun(capsys):
    Path("nothing").mkdir()
    assert main(["rerun", "nothing"]) == 1
    _one_line(capsys, "nothing")


def test_run_says_where_the_results_are_and_rerun_confirms_them(capsys):
    Path("s.yaml").write_text(GOOD)
    assert main(["run", "s.yaml", "--seed", "3", "--no-report"]) == 0
    said = capsys.readouterr().out
    folder = next(Path("results").glob("s-*"))
    assert f"Results: {folder} " in said and "\n\nResults" not in said
    for name in (
        "run.json",
        "scenario.resolved.yaml",
        "frames.parquet",
        "lookups.parquet",
        "metrics.json",
        "summary.md",
    ):
        assert (folder / name).is_file(), name
    assert not (folder / "figures").exists()
    assert main(["rerun", str(folder)]) == 0
    assert "frames.parquet: identical" in capsys.readouterr().out


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The result folder of a run."""
    out = tmp_path_factory.mktemp("made")
    (out / "s.yaml").write_text(GOOD)
    assert main(["run", str(out / "s.yaml"), "--no-report", "--out", str(out)]) == 0
    return next(out.glob("s-*"))


@pytest.fixture
def folder(made: Path) -> Path:
    """A copy, to be spoilt."""
    return Path(shutil.copytree(made, "result"))


def test_rerun_notices_a_result_that_was_changed(folder, capsys):
    path = folder / "frames.parquet"
    table = pq.read_table(path)
    pq.write_table(table.slice(1), path)  # what the file says of itself goes along
    about = json.loads((folder / "run.json").read_text())
    about["rows"]["frames"] -= 1
    (folder / "run.json").write_text(json.dumps(about))
    sign(folder)
    assert main(["rerun", str(folder)]) == 1
    assert "frames.parquet: DIFFERENT" in capsys.readouterr().out
    with path.open("r+b") as file:
        file.seek(200)
        file.write(b"\0\0\0\0")
    sign(folder)
    assert main(["rerun", str(folder)]) == 1
    assert f"{path}: " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda made: made.pop("run_id"), "run_id: missing"),
        (lambda made: made.pop("facts"), "facts.scenario: missing"),
        (lambda made: made.update(facts=3), "facts.scenario: missing"),
        (lambda made: made["facts"].pop("devices"), "facts.devices: missing"),
        (lambda made: made["facts"]["scenario"].pop("name"), "facts.scenario.name: missing"),
        (
            lambda made: made["facts"]["scenario"].update(seed="x"),
            "facts.scenario.seed: missing, or not a whole",
        ),
        (
            lambda made: made["facts"]["devices"]["jetson_tx2"].update(cores="x"),
            "run.json: cores: must be a mapping",
        ),
        (lambda made: made["facts"].pop("plugins"), "plugins: None when it was made, {} now"),
        (
            lambda made: made["facts"]["traces"].update(car1="00"),
            "traces.car1: '00' when it was made",
        ),
    ],
)
def test_a_damaged_run_json_gets_one_line(damage, message, folder, capsys):
    path = folder / "run.json"
    made = json.loads(path.read_text())
    damage(made)
    path.write_text(json.dumps(made))
    sign(folder)
    assert main(["rerun", str(folder)]) == 1
    _one_line(capsys, message)


def test_results_go_home_where_the_shell_has_not_said_so(capsys, monkeypatch):
    monkeypatch.setenv("HOME", str(Path("home:x").absolute()))
    Path("s.yaml").write_text(GOOD)
    assert main(["run", "s.yaml", "--no-report", "--out=~/lab"]) == 0
    assert next(Path("home:x/lab").glob("s-*/frames.parquet")).is_file()
    assert not Path("~").exists()


LOSSY = """
edges: [{name: edge1, device: agx_xavier}, {name: edge2, device: agx_xavier}]
cars:
  - {name: car1, device: jetson_tx2, edge: edge1, link: {like: wifi, loss: 0.1}}
  - {name: car2, device: jetson_tx2, edge: edge2, link: {like: wifi, loss: 0.1}}
"""
TOWN = """
perception: {source: town, duration: 2 s}
fleet: {cars: 2, devices: jetson_tx2, edge_device: agx_xavier, cell: 200 m}
"""


@pytest.mark.parametrize("scenario", [LOSSY, TOWN])
def test_the_same_run_under_another_hash_seed_gives_the_same_bytes(run_process, scenario: str):
    """The order of no set or dict shows, and nobody calls ``hash``."""
    Path("s.yaml").write_text(scenario)
    for seed in ("1", "2"):
        ran = run_process("run", "s.yaml", "--out", f"out{seed}", env={"PYTHONHASHSEED": seed})
        assert ran.returncode == 0
    first, second = (
        sorted(p for p in Path(f"out{seed}").rglob("*") if p.is_file()) for seed in ("1", "2")
    )
    assert [p.parts[1:] for p in first] == [p.parts[1:] for p in second]
    for one, other in zip(first, second, strict=True):
        if one.name != "run.json":  # it holds the wall time
            assert one.read_bytes() == other.read_bytes(), one


@pytest.mark.process
@pytest.mark.unix
@pytest.mark.parametrize("asked", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_command_leaves_nothing_and_exits_with_130(asked):
    Path("s.yaml").write_text(GOOD.replace("[0 s, 1 s]", "[0 s, 15 s], laps: 500"))
    run = subprocess.Popen(
        [sys.executable, "-m", "genie_sim", "run", "s.yaml"],
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        # a background job ignores it
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    while not Path("results").exists():  # made just before it simulates
        time.sleep(0.05)
    run.send_signal(asked)
    _, error = run.communicate(timeout=60)
    assert run.returncode == 130
    assert "Traceback" not in error
    assert "interrupted" in error
    assert not list(Path().glob("results/*"))


@pytest.mark.process
@pytest.mark.parametrize("line", [["list"], ["list", "methods"], ["--help"], ["import", "--help"]])
def test_what_people_read_is_there_without_docstrings(line: list[str]):
    """``python -OO`` throws them away."""
    usual, optimized = (
        subprocess.run(
            [sys.executable, *options, "-m", "genie_sim", *line],
            capture_output=True,
            text=True,
            env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
            check=True,
        )
        for options in ([], ["-OO"])
    )
    assert optimized.stdout == usual.stdout


@pytest.mark.process
@pytest.mark.unix
def test_interrupted_seeds_leave_nothing_half_done():
    Path("own.py").write_text(HANGS)
    Path("s.yaml").write_text(GOOD)
    line = ["s.yaml", "--seeds", "2", "--jobs", "2", "--methods", "genie"]
    line += ["--set", "genie.capacity=2 entries", "--set", "genie.eviction=own:Hangs"]
    run = subprocess.Popen(
        [sys.executable, "-m", "genie_sim", "run", *line],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "PYTHONPATH": str(REPOSITORY)},
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    while not Path("hangs").exists():
        assert run.poll() is None
        time.sleep(0.05)
    os.killpg(run.pid, signal.SIGINT)
    _, error = run.communicate(timeout=60)
    assert run.returncode == 130 and "Traceback" not in error
    assert not list(Path("results").rglob(".*.partial"))


HANGS = """
from pathlib import Path

from genie_sim.core.eviction import LRU


class Hangs(LRU):
    def stored(self, *about):
        Path("hangs").touch()
        while True:
            pass
"""


def test_interrupted_seeds_go_on_with_the_same_command(monkeypatch, capsys):
    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("genie_sim.study.study.Study.run", interrupt)
    Path("s.yaml").write_text(GOOD)
    assert main(["run", "s.yaml", "--seeds", "2", "--out", "lab"]) == 130
    _one_line(capsys, "interrupted; finished runs are kept in lab")


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        (
            "eviction=json:JSONDecoder",
            "eviction 'json:JSONDecoder': has no stored, used, removed, victim",
        ),
        (
            "eviction=json:nothing",
            "eviction 'json:nothing': module 'json' has no attribute 'nothing'",
        ),
        (
            "eviction=genie_sim.core.eviction:TTL",
            "missing 1 required positional argument: 'ttl_ns'",
        ),
        (
            "eviction={name: 'json:JSONDecoder', strict: true}",
            "genie.eviction: must be a name alone, without settings, not {",
        ),
        ("similarity=json:JSONDecoder", "similarity 'json:JSONDecoder': has no key, index"),
        ("similarity={name: 'genie_sim.core.similarity:Exact', reach: 3}", "unknown parameter of"),
        (
            "object_map.rule=math:sqrt",
            "confidence rule 'math:sqrt': TypeError: math.sqrt() takes exactly one argument",
        ),
        (
            "object_map.rule=math:pi",
            "confidence rule 'math:pi': TypeError: 'float' object is not callable",
        ),
        (
            "object_map.rule=broken:rule",
            "confidence rule 'broken:rule': expected ':' (broken.py, line 1)",
        ),
        (
            "object_map.rule=rules:big",
            "'rules:big': returned 1.7 for (0.5, 0.5, 0.1); expected a number from 0 to 1",
        ),
        ("object_map.rule=rules:late", "confidence rule 'rules:late': returned nan for "),
        (
            "object_map.rule=rules:text",
            "returned 'sure' for (0.5, 0.5, 0.1); expected a number from 0 to 1",
        ),
    ],
)
def test_a_users_own_policy_that_does_not_fit_gets_one_line(setting, message, capsys):
    Path("s.yaml").write_text(GOOD)
    Path("broken.py").write_text("def rule()\n")
    late = 'def late(c, s, r): return c if c == 0.5 else float("nan")\n'
    Path("rules.py").write_text(
        f"def big(c, s, r): return 1.7\ndef text(c, s, r): return 'sure'\n{late}"
    )
    assert main(["run", "s.yaml", "--no-report", "--set", f"genie.{setting}"]) == 1
    _one_line(capsys, message)
    assert not list(Path().glob("results/*"))


def test_list_shows_what_can_be_named(capsys):
    assert main(["list", "devices"]) == 0
    assert "jetson_tx2" in capsys.readouterr().out
    assert main(["list", "devicess"]) == 1
    _one_line(capsys, "did you mean 'devices'?")


def _one_line(capsys, message):
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1, said
    assert "Traceback" not in said


def test_a_users_own_policy_decides_the_run_id_by_its_code(run_cli):
    policy = "from genie_sim.core.eviction import LRU\n\n\nclass Mine(LRU):\n    pass\n"
    Path("s.yaml").write_text(GOOD + "genie: {eviction: 'mine:Mine'}\n")
    for text in (policy, policy + "# changed\n"):
        Path("mine.py").write_text(text)
        assert run_cli("run", "s.yaml", "--no-report").returncode == 0
    assert len(list(Path("results").glob("s-*"))) == 2


@pytest.mark.process
def test_the_main_command_imports_nothing_that_it_does_not_need():
    """Each of these takes as long to import as the simulation takes."""
    code = (
        "import sys; from genie_sim.cli.main import main; status = main(['run', 'street_1car_homo',"
        " '--no-report', '--set', 'cars[0].route.window=[0 s, 1 s]']); print('imported:',"
        " sorted({'pandas', 'matplotlib', 'scipy', 'cv2', 'PIL'} & set(sys.modules)));"
        " sys.exit(status)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.endswith("imported: []\n"), done.stdout[-200:]


def test_a_page_without_a_replay_has_no_start(tmp_path, capsys):
    folder = copied(REPOSITORY / "results" / "paper", tmp_path / "paper")
    assert main(["report", str(folder), "--start", "1 s"]) == 1
    assert f"--start: {folder} holds no single run" in capsys.readouterr().err
