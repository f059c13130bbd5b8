"""Reads scenarios: YAML files with ``path=value`` overrides, checked for everything that can be
known before simulating.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from genie_sim.base import files, plugins
from genie_sim.base.errors import UserError
from genie_sim.base.settings import SettingError, from_plain
from genie_sim.scenario import checks, setting_paths
from genie_sim.scenario.methods import MethodEntry
from genie_sim.scenario.overrides import apply_overrides
from genie_sim.scenario.scenario import ReadFrom, Scenario
from genie_sim.scenario.yaml_input import read_mapping
from genie_sim.sim.method import METHODS


def load_scenario(
    path_or_name: str | Path,
    overrides: Sequence[str] = (),
    seed: int | None = None,
    *,
    settings_from: str = "--set",
    methods: Sequence[str] = (),
    methods_from: str = "methods",
) -> Scenario:
    """A scenario file, by path or by name; for the rest see ``read_scenario``. Raises
    ``UserError``.
    """
    path = files.find(files.SCENARIO, path_or_name)
    data = read_mapping(path)
    data.setdefault("name", path.stem)
    return read_scenario(
        data,
        overrides,
        seed,
        where=str(path),
        settings_from=settings_from,
        methods=methods,
        methods_from=methods_from,
    )


def read_scenario(
    data: Mapping[str, Any],
    overrides: Sequence[str] = (),
    seed: int | None = None,
    where: str = "scenario",
    *,
    settings_from: str = "--set",
    methods: Sequence[str] = (),
    methods_from: str = "methods",
) -> Scenario:
    """The scenario in ``data``.

    Parameters
    ----------
    data : mapping
        Plain data as in YAML.
    overrides : sequence of str
        Settings to change, as ``path=value``.
    seed : int, optional
        A seed in place of the one in ``data``.
    where : str
        The file, to begin errors with.
    settings_from : str
        What gave the ``overrides``, to begin errors with.
    methods : sequence of str
        Only these, in this order: entries of the scenario by name, else methods by themselves.
        None: those of the scenario.
    methods_from : str
        What gave ``methods``, to begin errors with.

    Raises
    ------
    UserError
        In one line, for the first mistake.
    """

    def read(count: int) -> Scenario:
        """With the first so many of the overrides. Raises ``SettingError``."""
        settings, applied = apply_overrides(Scenario, data, overrides[:count], settings_from)
        if seed is not None:
            settings["seed"] = seed
        read_from = ReadFrom(where, tuple(applied))
        scenario = replace(from_plain(Scenario, settings), read_from=read_from)
        if methods:
            scenario = _with_methods(scenario, methods, methods_from)
        return _checked(scenario)

    try:
        return read(len(overrides))
    except SettingError as error:
        message = error.message
        if error.stray:
            message = setting_paths.hint(Scenario, error.field) or message
        count = _first_wrong(read, error, len(overrides))
        source = f"{settings_from} {overrides[count - 1]}".lstrip() if count else where
        raise UserError(": ".join(filter(None, (source, error.field, message)))) from error


def _first_wrong(read: Callable[[int], Scenario], error: SettingError, count: int) -> int:
    """How many overrides it takes for an error that ``count`` of them give."""
    for fewer in range(count):
        try:
            read(fewer)
        except SettingError as other:
            if (other.field, other.text) == (error.field, error.text):
                return fewer
        except UserError:
            pass
    return count


def _with_methods(scenario: Scenario, names: Sequence[str], where: str) -> Scenario:
    entries: dict[str, MethodEntry] = {entry.name: entry for entry in scenario.methods}
    for name in names:
        try:
            plugins.checked_name("method", name, {**METHODS, **entries})
        except ValueError as error:
            raise UserError(f"{where}: {error}") from error
        if names.count(name) > 1:
            raise UserError(f"{where}: duplicate name {name!r}")
        if name not in entries:
            entries[name] = from_plain(MethodEntry, name)
    return replace(scenario, methods=tuple(entries[name] for name in names))


def _checked(scenario: Scenario) -> Scenario:
    """The scenario with what the files that it names say. Raises ``SettingError`` unless the
    settings fit together, and to these files.
    """
    sequence, profiles = checks.sequence(scenario), checks.profiles(scenario)
    scenario = replace(scenario, sequence=sequence, profiles=profiles)
    checks.check(scenario)
    return scenario
