"""Tables of the town's laws reach as far as a camera may look."""

from genie_sim.worlds.scene import laws
from genie_sim.worlds.scene.laws import MAX_VIEW_M


def test_there_is_a_row_for_every_metre_up_to_the_farthest_view():
    """A range is rounded to whole metres, up."""
    assert laws.RANGES > MAX_VIEW_M + 1
