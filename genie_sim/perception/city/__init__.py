"""A generated town with ground truth, for fleets of thousands of cars; its detector is fitted on a real trace."""

from genie_sim.perception.city.camera import CityFrame
from genie_sim.perception.city.rules import TownRules, TrueObject
from genie_sim.perception.city.town import Drive, Town

__all__ = ["CityFrame", "Drive", "Town", "TownRules", "TrueObject"]
