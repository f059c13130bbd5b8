"""What a shell may complete besides commands and options; paths it completes itself."""

from collections.abc import Callable, Iterable
from importlib import import_module

Completion = Callable[[object, object, str], list[str]]  # as click's shell_complete takes it


def _completion(names: Callable[[], Iterable[str]]) -> Completion:
    """Completes one of these names, which are looked up when a shell asks, also behind a comma."""

    def complete(_: object, __: object, incomplete: str) -> list[str]:
        before, comma, last = incomplete.rpartition(",")
        return [f"{before}{comma}{name}" for name in names() if name.startswith(last)]

    return complete


def fixed(*words: str) -> Completion:
    """Completes one of these words."""
    return _completion(lambda: words)


def _of_files(*kinds: str) -> Completion:
    """Completes the name of a file of one of these ``files.FileKind``."""

    def names() -> list[str]:
        from genie_sim.base import files

        return sorted({name for kind in kinds for name in files.available(getattr(files, kind))})

    return _completion(names)


def _of(*places: str) -> Completion:
    """Completes what stands in these lists and tables, each ``module:NAME``."""

    def names() -> Iterable[str]:
        for place in places:
            module, _, name = place.partition(":")
            yield from getattr(import_module(f"genie_sim.{module}"), name)

    return _completion(names)


def _settings() -> Iterable[str]:
    from genie_sim.scenario.scenario import Scenario
    from genie_sim.scenario.setting_paths import setting_paths

    return [f"{path}=" for path in setting_paths(Scenario)]


scenarios = _of_files("SCENARIO")
sweeps = _of_files("SWEEP")
files_by_name = _of_files("SCENARIO", "SWEEP", "DEVICE")
methods = _of("sim.method:METHODS")
metrics = _of("analysis.registry:METRICS")
figures = _of("analysis.style:RUN_FIGURES", "analysis.registry:METRICS")
widths = _of("analysis.style:WIDTHS")
kinds = _of("cli.catalogue:KINDS")
setting_paths = _completion(_settings)
