"""Whatever option is refused, the line names what to write; options mean the same everywhere."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

import click
import pytest

from genie_sim.cli.main import app, main


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (
            "run x --edge-network y",
            "'--edge-network': a setting is changed with --set edge_network=",
        ),
        ("run x --edge-netwrk y", "a setting is changed with --set edge_network=VALUE"),
        ("run x --device orin", "--set convoy.device=VALUE or --set cars[0].device=VALUE"),
        ("run x --cars 5", "or --set fleet.cars=VALUE"),
        ("run x --format pdf", "'--format': it is an option of 'table', 'figures', "),
        ("table x --width 3.5", "'--width': it is an option of 'figures', and stands behind"),
        ("--seed 3 run x", "'--seed': it is an option of 'run', 'search', and stands behind"),
        ("run x --sed 3", "'--sed' (did you mean '--seed'?)"),
        ("run x --metric a", "'--metric' (did you mean '--metrics'?)"),
        ("sweep x --seed 3", "'--seed' (did you mean '--seeds'?)"),
        ("run x --frobnicate", "'--frobnicate'; known: --set, --seed, --methods, "),
        ("run x -s 3", "'-s'; known: --set, "),
        ("run x --workers 3", "'--workers', which was removed. Write --jobs N"),
        ("compare x --labels a,b", "which was removed. Write --label A --label B, one for each"),
        ("import tables a b --size 3", "which was removed. Write --frame-size SIZE"),
        ("import linkk", "unknown command 'linkk' (did you mean 'link'?); known: "),
        ("sweep x --backend dask", "'--backend', which was removed. Write --scheduler ADDRESS"),
    ],
)
def test_an_option_that_is_not_there_is_answered_with_the_one_to_use(line, message, capsys):
    assert main(line.split()) == 2
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1
    assert said.endswith("--help\n")


def options(group: click.Group, above: str = "") -> Iterator[tuple[str, click.Option]]:
    for name, command in group.commands.items():
        for parameter in command.params:
            if isinstance(parameter, click.Option):
                yield f"{above}{name}", parameter
        if isinstance(command, click.Group):
            yield from options(command, f"{above}{name} ")


def test_an_option_of_several_commands_takes_the_same_in_each():
    """In the help of each it has one placeholder, and may be repeated or not."""
    found: dict[str, dict[tuple[str | None, bool], str]] = defaultdict(dict)
    for command, option in options(app):
        kind = (option.metavar, option.multiple)
        found[option.opts[0]].setdefault(kind, command)
    # what runs gets one label, what is shown one for each result; formats are those of each command
    differ = {"--label", "--format", "--seeds"}
    assert {name for name, kinds in found.items() if len(kinds) > 1} <= differ
    assert found["--seeds"] == {("N|A,B,...", False): "run", ("N", False): "reproduce"}


def test_what_runs_and_what_is_shown_takes_the_usual_options():
    has: dict[str, set[str]] = defaultdict(set)
    for command, option in options(app):
        has[command].add(option.opts[0])
    for command in ("run", "sweep"):
        assert {"--set", "--methods", "--seeds", "--label", "--jobs", "--out"} <= has[command]
    for command in ("table", "compare"):
        assert {"--methods", "--metrics", "--label", "--allow-changed"} <= has[command]
    assert {"--methods", "--label", "--only"} <= has["figures"]
    assert len(app.commands) <= 16
