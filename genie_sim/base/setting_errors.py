"""Mistakes in settings: what is wrong, and the path of the field.

Until the files that a scenario names are open, raise ``SettingError(path, text)``; afterwards, as
when a run is prepared, ``raise scenario.error_at(path, text)``, a ``UserError`` that begins with
the file, or the override, which set it. ``settings.read`` makes the former a ``UserError``, too.
What a part raises that knows no path becomes a ``SettingError``: in the constructor of a settings
class by ``settings.built``, elsewhere within ``scenario.checks.blamed_on(path)``.
"""

import re
from collections.abc import Iterable, Sequence

from genie_sim.base.errors import short_repr


class SettingError(ValueError):
    """``text`` is wrong with ``field``, a path such as ``cars[1].edge`` below the settings that are
    read. ``more`` counts the mistakes besides; ``stray`` is a field that nothing there is called
    like.
    """

    def __init__(self, field: str, text: str, more: int = 0, stray: bool = False) -> None:
        super().__init__(f"{field}: {text}" if field else text)
        self.field, self.text, self.more, self.stray = field, text, more, stray

    def below(self, step: str | int) -> "SettingError":
        """The same error, seen from the settings that hold these under ``step``."""
        return SettingError(join(step, self.field), self.text, self.more, self.stray)

    @property
    def message(self) -> str:
        """The text, and how many mistakes there are besides."""
        mistakes = "mistake" if self.more == 1 else "mistakes"
        return self.text + (f" (and {self.more} more {mistakes})" if self.more else "")


def quoted(key: object) -> str:
    """A key as part of a path; in quotes if it is no plain word."""
    return key if isinstance(key, str) and re.fullmatch(r"[\w-]{1,40}", key) else short_repr(key)


def join(step: str | int, path: str) -> str:
    """``path`` below a name, a path or an index: ``cars[1].edge``."""
    begin = f"[{step}]" if isinstance(step, int) else step
    return begin + path if not path or not begin or path.startswith("[") else f"{begin}.{path}"


def check_unique(field: str, names: Sequence[str], of: str = "", also: Iterable[str] = ()) -> None:
    """Raises ``SettingError`` for the first name that comes twice.

    Parameters
    ----------
    field : str
        The list that the names are from.
    names : sequence of str
        They themselves.
    of : str
        The path of a name below its entry of the list, such as ``.name``.
    also : iterable of str
        Names that are taken already.
    """
    taken = set(also)
    for index, name in enumerate(names):
        if name in taken:
            raise SettingError(f"{field}[{index}]{of}", f"duplicate name {name!r}")
        taken.add(name)


def must(text: str, value: object) -> SettingError:
    """That a value must be as ``text`` says, and is not."""
    return SettingError("", f"must {text}, not {short_repr(value)}")
