"""genie-sim: a discrete-event simulator of Genie, smart ROS caching for connected autonomous
robots.

As a library: ``import genie_sim as gs; run = gs.run("3car_hetero")``; see ``genie_sim.api``, which
is imported when it is first used. Which room may import which others stands in ``MAY_IMPORT`` of
``tests/test_imports.py`` alone.
"""

from typing import TYPE_CHECKING, Any

from genie_sim.version import VERSION

if TYPE_CHECKING:
    from genie_sim.api import (
        Comparison,
        Run,
        Runs,
        Scenario,
        UserError,
        compare,
        load,
        load_scenario,
        reproduce,
        run,
        run_seeds,
        sweep,
    )

__version__ = VERSION
__all__ = [
    "Comparison",
    "Run",
    "Runs",
    "Scenario",
    "UserError",
    "__version__",
    "compare",
    "load",
    "load_scenario",
    "reproduce",
    "run",
    "run_seeds",
    "sweep",
]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        import difflib

        near = difflib.get_close_matches(name, __all__, n=1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}{hint}", name=name)
    from genie_sim import api

    return getattr(api, name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
