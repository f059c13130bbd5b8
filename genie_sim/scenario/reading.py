"""Reads scenarios: YAML files with ``path=value`` overrides, checked for everything that can be
known before simulating.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from genie_sim.base import files, plugins
from genie_sim.base.errors import UserError
from genie_sim.base.setting_errors import SettingError
from genie_sim.base.settings import from_plain
from genie_sim.scenario import checks, setting_paths
from genie_sim.scenario.methods import MethodEntry
from genie_sim.scenario.overrides import apply_overrides
from genie_sim.scenario.profiles import DeviceProfile, load_profile
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
    profiles: Mapping[str, DeviceProfile] = MappingProxyType({}),
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
    profiles : mapping
        Device profiles, by the name or path that ``data`` gives them; others are loaded.

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
        return _checked(replace(scenario, profiles=profiles))

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
    sequence, profiles = _recorded_sequence(scenario), _loaded_profiles(scenario)
    scenario = replace(scenario, sequence=sequence, profiles=profiles)
    checks.check(scenario)
    return scenario


def _recorded_sequence(scenario: Scenario) -> str | None:
    """The sequence whose recordings the cars replay, each its own; ``None`` where they are of none.

    Raises ``SettingError`` where the recordings would lose their common clock.
    """
    if scenario.perception.name != "recorded":
        return None
    main = scenario.perception.parameters["trace"]
    traces = [car.route.trace or main for car in scenario.cars]
    if len(set(traces)) < 2:
        return None
    from genie_sim.data.trace import sequence_of

    sequences = {}
    for trace in dict.fromkeys(traces):
        with suppress(UserError):  # told by `check` with its setting, or when it is read
            sequences[trace] = sequence_of(files.find(files.TRACE, trace))
    named = [sequence for sequence in sequences.values() if sequence is not None]
    if len(named) == len(set(named)):
        return None
    for index, (car, trace) in enumerate(zip(scenario.cars, traces, strict=True)):
        place = f"cars[{index}].route"
        if sequences.get(trace) != named[0] or trace in traces[:index]:
            text = f"the cars drive together in {named[0]}: each needs a recording of it, its own"
            raise SettingError(f"{place}.trace", text)
        if replace(car.route, trace=None) != replace(scenario.cars[0].route, trace=None):
            text = f"the recordings of {named[0]} are on one clock: all routes must be alike"
            raise SettingError(place, f"{text} but for 'trace'")
    if scenario.start_jitter_ns:
        text = f"the recordings of {named[0]} are on one clock: must be 0 s"
        raise SettingError("start_jitter", text)
    return named[0]


def _loaded_profiles(scenario: Scenario) -> dict[str, DeviceProfile]:
    """The profile of every device, by the name or path that the scenario gives it; those that it
    has already are not loaded again. Raises ``SettingError`` with the path where that stands first,
    also where two that differ call themselves the same: power is measured by that name.
    """
    named = [(car.device, f"cars[{index}].device") for index, car in enumerate(scenario.cars)]
    named += [(edge.device, f"edges[{index}].device") for index, edge in enumerate(scenario.edges)]
    if scenario.fleet is not None:
        named += [(device, "fleet.devices") for device in scenario.fleet.devices]
        named.append((scenario.fleet.edge_device, "fleet.edge_device"))
    loaded: dict[str, DeviceProfile] = {}
    for device, path in named:
        if device not in loaded:
            with checks.blamed_on(path):
                profile = scenario.profiles.get(device) or load_profile(device)
            for other, earlier in loaded.items():
                if earlier.name == profile.name and earlier != profile:
                    text = f"{device!r} and {other!r} differ, but both have the name"
                    raise SettingError(path, f"{text} {profile.name!r}: give one another 'name'")
            loaded[device] = profile
    return loaded
