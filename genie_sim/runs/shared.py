"""Traces that several runs share."""

import json

from genie_sim.base.settings import plain_data
from genie_sim.data.frame_source import Frames
from genie_sim.runs.prepare import Prepared, prepare, prepare_with_frames
from genie_sim.scenario.scenario import Scenario

# Settings that say nothing about which profiles and traces are needed.
_SAME_FILES = {
    "name",
    "description",
    "seed",
    "methods",
    "model",
    "spread",
    "start_jitter",
    "queue_length",
    "edge_network",
    "genie",
    "faults",
}


class SharedFrames:
    """Traces, read once for all points that need the same ones; ``frames`` is what their runs
    share.
    """

    def __init__(self) -> None:
        self.frames: dict[str, Frames] = {}
        self._known: dict[str, Frames] = {}

    def prepare(self, scenario: Scenario) -> Prepared:
        """As ``prepare`` alone."""
        needs = json.dumps(
            {key: item for key, item in plain_data(scenario).items() if key not in _SAME_FILES}
        )
        known = self._known.get(needs)
        prepared = prepare(scenario) if known is None else prepare_with_frames(scenario, known)
        if not prepared.frames.seeded:
            self._known[needs] = self.frames.setdefault(_key(prepared), prepared.frames)
        return prepared


def _key(prepared: Prepared) -> str:
    """Names the frames that a scenario needs."""
    scenario = prepared.facts["scenario"]
    source = json.dumps({key: scenario[key] for key in ("perception", "origin")})
    return f"{source} {sorted(prepared.frames.digests().items())}"
