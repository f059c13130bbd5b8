"""The paths of all settings of a scenario, as ``--set`` takes them, for hints."""

from collections.abc import Callable, Iterator
from typing import Any

from genie_sim.base.plugins import Choice
from genie_sim.base.setting_errors import join
from genie_sim.base.settings import Kind, PlugIn, is_settings_class, settings_of

MAX_HINTS = 3


def hint(cls: type, path: str) -> str:
    """What the unknown field at ``path`` of a settings class may be: settings of that name at other
    places, of lists in the first entry, such as ``cars[0].device``; empty where there are none.
    """
    word = path.rpartition(".")[2]
    paths = dict.fromkeys(_below(Kind.of(cls), "", ()))
    same = [other for other in paths if other.rpartition(".")[2] == word]
    texts = [repr(other) for other in sorted(same, key=len)[:MAX_HINTS]]
    return f"unknown field; did you mean {' or '.join(texts)}?" if same else ""


def _below(kind: Kind, path: str, above: tuple[Any, ...]) -> Iterator[str]:
    """Every setting below a path; ``above`` are the classes that lead here, which are not entered
    again.
    """
    for member in kind.members:
        if member.type is tuple and member.arguments and path != "methods":
            yield from _below(member.items[0], f"{path}[0]", above)
        for cls in _classes(member):
            for setting in settings_of(cls) if cls not in above else ():
                yield join(path, setting.key)
                yield from _below(setting.kind, join(path, setting.key), (*above, cls))


def _classes(kind: Kind) -> Iterator[Callable[..., Any]]:
    """Whose settings may stand there."""
    plug_in: PlugIn | None = kind.marks.get(PlugIn)
    if is_settings_class(kind.type):
        yield kind.type
    elif kind.type is Choice and plug_in is not None and not plug_in.beside:
        yield from map(plug_in.resolve, plug_in.registry)
