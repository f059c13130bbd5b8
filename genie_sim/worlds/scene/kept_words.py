"""Words that kept runs, or the draws of their random numbers, hold: they are frozen, whatever would
be said today.
"""

# Of what all random numbers of a scene are: another word draws every seed anew.
TOWN_DRAWS, TRAFFIC_DRAWS = "city", "traffic"
# ``placed_by`` of all detections, in traffic too.
PLACED_BY = "town"
# What a town's ``run.json`` says its detector is, as the measured laws of detectors name it.
TOWN_DETECTOR = "town"


def town_drive(seed: int) -> str:
    """What drives through the town of a seed are called there."""
    return f"town/{seed}"
