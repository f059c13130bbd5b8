"""Classes of road objects: groups, and sizes that a street knows."""

from genie_sim.base.classes import CANONICAL, PERSONS, ROAD_LABELS, SIZES, VEHICLES, class_of


def test_what_a_detector_confuses_is_one_class():
    assert {class_of(label) for label in VEHICLES} == {"car"}
    assert class_of("person") == "person" and set(PERSONS) == {"person"}
    assert class_of("bench") == "bench" and "bench" not in CANONICAL


def test_sizes_are_those_of_a_street():
    """Vehicles are longer than wide and fit a lane of 3.5 m; a person and furniture are slim;
    nothing that stands on a pavement is taller than a person but what holds a lamp.
    """
    assert {*SIZES} == ROAD_LABELS
    for label in (*VEHICLES, "train", "bicycle", "motorcycle"):
        assert SIZES[label].length_m > SIZES[label].width_m > 0, label
    assert all(size.width_m < 3.5 and size.height_m < 4 for size in SIZES.values())
    person = SIZES["person"]
    assert 1.5 < person.height_m < 2 and max(person[:2]) <= 0.6
    for label in ("traffic light", "stop sign", "fire hydrant", "parking meter", "bench"):
        assert SIZES[label].height_m < person.height_m, label
        assert max(SIZES[label][:2]) < person.height_m, label
    assert SIZES["bicycle"].height_m < SIZES["motorcycle"].height_m < person.height_m
    assert 3.5 < SIZES["car"].length_m < SIZES["truck"].length_m == SIZES["bus"].length_m < 6
    assert SIZES["car"].height_m < SIZES["bus"].height_m < SIZES["truck"].height_m
    assert 2 < SIZES["train"].length_m / SIZES["truck"].length_m < 5
    assert SIZES["train"].height_m > SIZES["truck"].height_m
    assert SIZES["bicycle"].length_m < SIZES["motorcycle"].length_m < SIZES["car"].length_m
