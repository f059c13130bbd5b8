"""genie-sim: a discrete-event simulator of Genie, smart ROS caching for connected autonomous robots.

As a library: ``import genie_sim as gs; run = gs.run("3car_hetero")``; see ``genie_sim.api``, which is imported when it
is first used.
"""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from genie_sim.api import (
        Figures,
        Run,
        Scenario,
        UserError,
        compare,
        differences,
        load,
        load_scenario,
        run,
        sweep,
    )

__version__ = "0.1.0"
__all__ = [
    "Figures", "Run", "Scenario", "UserError", "__version__", "compare", "differences", "load", "load_scenario", "run",
    "sweep",
]  # fmt: skip


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from genie_sim import api

    return getattr(api, name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
