"""A generated town with ground truth, for fleets of thousands of cars; its detector is fitted on a
real trace.

``rules`` says what it is made of, ``streets`` lays out what stands and moves on each street,
``places`` finds what of it is in view from somewhere, ``commuting`` says which way cars go and
``routes`` how they drive it, ``town`` is all of it as a scene (``worlds.scene``), and ``source``
has the settings in a scenario.
"""

from genie_sim.worlds.town.rules import TownRules
from genie_sim.worlds.town.town import Town

__all__ = ["Town", "TownRules"]
