"""Reads scenarios: YAML files with ``path=value`` overrides, checked for everything that can be
known before simulating.
"""

import copy
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from genie_sim.base import files, plugins
from genie_sim.base.errors import UserError
from genie_sim.base.settings import SettingError, from_plain, plain_data
from genie_sim.methods import METHODS
from genie_sim.scenario import checks, setting_paths
from genie_sim.scenario.methods import MethodEntry
from genie_sim.scenario.overrides import apply_overrides
from genie_sim.scenario.scenario import Origin, Scenario
from genie_sim.scenario.yaml_input import read_mapping
from genie_sim.sim.settings import FOUR_CAMERAS


def load_scenario(
    path_or_name: str | Path,
    overrides: Sequence[str] = (),
    seed: int | None = None,
    *,
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
        data, overrides, seed, where=str(path), methods=methods, methods_from=methods_from
    )


def read_scenario(
    data: Mapping[str, Any],
    overrides: Sequence[str] = (),
    seed: int | None = None,
    where: str = "scenario",
    *,
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
    settings = copy.deepcopy(dict(data))
    if "cameras" not in settings and any(text.startswith("cameras[") for text in overrides):
        settings["cameras"] = [plain_data(camera) for camera in FOUR_CAMERAS]  # one is changed
    origin = Origin(where, tuple(apply_overrides(settings, overrides)))
    if seed is not None:
        settings["seed"] = seed
    try:
        scenario = replace(from_plain(Scenario, settings), read_from=origin)
        if methods:
            scenario = _with_methods(scenario, methods, methods_from)
        return _checked(scenario)
    except SettingError as error:
        message = error.message
        if message.startswith("unknown field"):
            message = setting_paths.hint(Scenario, error.field, message)
        parts = (origin.of(error.field), error.field, message)
        raise UserError(": ".join(part for part in parts if part)) from error


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
