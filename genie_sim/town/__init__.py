"""A generated town with ground truth, for fleets of thousands of cars; its detector is fitted on a
real trace.
"""

from genie_sim.town.frames import TownFrame
from genie_sim.town.rules import TownRules
from genie_sim.town.town import Town, TownDrive

__all__ = ["Town", "TownDrive", "TownFrame", "TownRules"]
