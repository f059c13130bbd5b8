"""Inflated scores: an attacker is sure of all that its detector says."""

from dataclasses import dataclass

from genie_sim.base.settings import Share
from genie_sim.faults.attacks.attack import Attack, AttackedScene, with_score
from genie_sim.sim.bends import Objects


@dataclass(kw_only=True)
class Inflate(Attack):
    """Every object has a high score, false ones of the detector included."""

    score: Share = 0.99
    """The score."""

    def forge(self, objects: Objects, scene: AttackedScene) -> Objects:
        return tuple(with_score(item, self.score) for item in objects)
