"""What a shell may complete besides commands and options; paths it completes itself."""

from collections.abc import Callable, Iterable

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


def _methods() -> Iterable[str]:
    from genie_sim.sim.method import METHODS

    return METHODS


def _metrics() -> Iterable[str]:
    from genie_sim.analysis.registry import METRICS

    return METRICS


def _figures() -> Iterable[str]:
    from genie_sim.analysis.style import RUN_FIGURES

    return (*RUN_FIGURES, *_metrics())


def _widths() -> Iterable[str]:
    from genie_sim.analysis.style import WIDTHS

    return WIDTHS


def _kinds() -> Iterable[str]:
    from genie_sim.cli.catalogue import KINDS

    return KINDS


def _settings() -> Iterable[str]:
    from genie_sim.scenario.scenario import Scenario
    from genie_sim.scenario.setting_paths import setting_paths

    return [f"{path}=" for path in setting_paths(Scenario)]


scenarios = _of_files("SCENARIO")
sweeps = _of_files("SWEEP")
files_by_name = _of_files("SCENARIO", "SWEEP", "DEVICE")
methods = _completion(_methods)
metrics = _completion(_metrics)
figures = _completion(_figures)
widths = _completion(_widths)
kinds = _completion(_kinds)
setting_paths = _completion(_settings)
