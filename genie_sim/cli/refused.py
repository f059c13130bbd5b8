"""What to write instead of an option that a command does not have."""

import difflib
from collections.abc import Iterator, Sequence

import click

from genie_sim.base.removed import instead_of_option
from genie_sim.base.text import one_line

MISSPELT = 0.8  # of difflib's ratio: above it a misspelt word, below it perhaps another one
MAX_PATHS = 3  # of settings that are told


def advice(error: click.NoSuchOption) -> str:
    """The rest of a line that begins with the option: what it was renamed to, the option that is
    meant, the setting of that name, the commands that have it, or the options that there are.
    """
    context, option = error.ctx, error.option_name
    assert context is not None
    own = list(_options(context.command))
    if instead := instead_of_option(context.command_path, option):
        return f", which was removed. {instead}"
    if near := difflib.get_close_matches(option, own, n=1, cutoff=MISSPELT):
        return f" (did you mean {near[0]!r}?)"
    within = "genie." if context.command_path.endswith(" attach") else ""
    if "--set" in own and (paths := _settings(option, within)):
        return f": a setting is changed with {' or '.join(f'--set {path}=VALUE' for path in paths)}"
    root = context.find_root()
    if others := [name for name, has in _commands(root.command) if option in has]:
        return f": it is an option of {', '.join(map(repr, others))}, and stands behind its name"
    text = f"; known: {', '.join(own)}"
    near = difflib.get_close_matches(option, own, n=1)
    return f" (did you mean {near[0]!r}?){text}" if near else text


def _options(command: click.Command) -> Iterator[str]:
    for parameter in command.params:
        if isinstance(parameter, click.Option):
            yield from (name for name in parameter.opts if name.startswith("--"))


def _commands(command: click.Command, above: str = "") -> Iterator[tuple[str, Sequence[str]]]:
    """Every command by its name below the first, with its options."""
    for name, inner in command.commands.items() if isinstance(command, click.Group) else ():
        yield f"{above}{name}", list(_options(inner))
        yield from _commands(inner, f"{above}{name} ")


def _settings(option: str, within: str) -> list[str]:
    """The paths of settings with the option's name, else with one that is close; all begin with
    ``within``.
    """
    from genie_sim.scenario.scenario import Scenario
    from genie_sim.scenario.setting_paths import setting_paths

    word = one_line(option).lstrip("-").replace("-", "_")
    by_word: dict[str, list[str]] = {}
    for path in filter(lambda path: path.startswith(within), setting_paths(Scenario)):
        by_word.setdefault(path.rpartition(".")[2], []).append(path)
    for name in difflib.get_close_matches(word, by_word, n=1, cutoff=MISSPELT):
        return sorted(by_word[name], key=len)[:MAX_PATHS]
    return []
