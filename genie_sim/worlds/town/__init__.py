"""A generated town with ground truth, for fleets of thousands of cars; its detector is fitted on a
real trace.
"""

from genie_sim.worlds.scene.frames import SceneFrame
from genie_sim.worlds.town.rules import TownRules
from genie_sim.worlds.town.town import Town, TownDrive

__all__ = ["SceneFrame", "Town", "TownDrive", "TownRules"]
