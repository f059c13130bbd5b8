"""What a replay of a run needs: where each frame was taken, and every change of every object
map.
"""

from __future__ import annotations

from dataclasses import replace

import pandas as pd
import pytest

from genie_sim.data.sources import RecordedDrives
from genie_sim.record.records import Tables
from genie_sim.runs.prepare import prepare
from genie_sim.runs.simulate import simulate
from genie_sim.scenario.profiles import load_profile
from tests.make import scenario, street


@pytest.fixture(scope="module")
def tables() -> Tables:
    return simulate(prepare(scenario(cars=2, seed=3), frames=RecordedDrives(street())))


def test_each_frame_has_one_pose_whatever_the_number_of_methods(tables):
    frames, poses = tables["frames"].to_frame(), tables["poses"].to_frame()
    genie = frames[frames["method"] == "genie"]
    key = ["car", "stream", "frame", "stamp_ns"]
    assert not poses.duplicated(key).any()
    assert len(poses.merge(genie, on=key)) == len(genie) == len(poses)


def test_a_map_changes_as_often_as_its_look_ups_say(tables):
    """Every sighting is a change: an update of what is known, or a new object. So the changes'
    gains add up to the boost of the look-ups, and the objects told apart to the entries of the map.
    """
    objects, lookups = tables["objects"].to_frame(), tables["lookups"].to_frame()
    sightings = lookups[lookups["kind"] == "sighting"]
    assert len(objects) == sightings["requests"].sum() > 100
    for genie, changes in objects.groupby("genie", observed=True):
        told = sightings[sightings["genie"] == genie]
        each = changes.groupby("object")["confidence"]
        assert len(each) == told["entries"].iloc[-1]
        gains = each.last() - each.first()
        assert gains.sum() == pytest.approx(told["boost_sum"].sum())


def test_objects_stay_where_they_were_first_seen(tables):
    """Parked cars, 8 m apart, 4 m north of the lane."""
    objects = tables["objects"].to_frame()
    assert set(objects["north_m"]) == {4.0}
    assert (objects["east_m"] % 8 == 0).all()
    assert objects["confidence"].between(0, 1).all()
    assert isinstance(objects, pd.DataFrame) and objects["t_ns"].is_monotonic_increasing


def test_what_a_map_forgets_has_a_last_row_without_confidence():
    devices = dict.fromkeys(("jetson_tx2", "agx_xavier"), load_profile("jetson_tx2"))
    setting = scenario(genie={"object_map": {"forget_after": "500 ms"}})
    tables = simulate(prepare(replace(setting, profiles=devices), frames=RecordedDrives(street())))
    objects, lookups = tables["objects"].to_frame(), tables["lookups"].to_frame()
    sightings = lookups[lookups["kind"] == "sighting"]
    assert objects["confidence"].isna().any()
    for genie, changes in objects.groupby("genie", observed=True):
        held: set[int] = set()
        told = iter(sightings[sightings["genie"] == genie].itertuples())
        for t_ns, rows in changes.groupby("t_ns"):
            for row in rows.itertuples():
                which = row.object
                if row.confidence != row.confidence:
                    held.remove(which)
                else:
                    held.add(which)
            sighting = next((one for one in told if one.t_ns == t_ns), None)
            assert sighting is None or sighting.entries == len(held)
