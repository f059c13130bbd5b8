"""A run with several seeds: a study without axes that keeps the whole results of every run."""

import hashlib
import json
from collections.abc import Sequence

from genie_sim.base.settings import plain_data
from genie_sim.scenario.scenario import Scenario
from genie_sim.study.design import Design, read_design
from genie_sim.version import VERSION

MAX_NAME = 70  # characters of the scenario's name


def design_of(scenario: Scenario, seeds: int | Sequence[int]) -> Design:
    """The study of a scenario under these seeds, or so many: 5 are the seeds 1 to 5. Its name, and
    so its folder, is that of all runs that differ in nothing but the seed. Raises ``UserError``.
    """
    facts = {**plain_data(scenario), "seed": None, "genie_sim": VERSION}
    digest = hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()[:12]
    data = {
        "name": f"{scenario.name[:MAX_NAME]}-{digest}-seeds",
        "scenario": scenario.name,
        "seeds": seeds if isinstance(seeds, int) else list(seeds),
    }
    return read_design(data, scenario.name)
