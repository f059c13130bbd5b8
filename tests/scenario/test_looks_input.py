"""Settings of the recommended Genie that cannot be: each in one line that names field and value."""

from __future__ import annotations

import pytest

from genie_sim.base.errors import UserError
from genie_sim.scenario.reading import load_scenario


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ("similarity: exact", "similarity: unknown parameter of recommended 'similarity'"),
        ("every: -1 ms", "every: must not be negative, but is '-1 ms'"),
        ("in_flight: 0", "in_flight: must be at least 1, not 0"),
        ("stale: 0 ms", "stale: must be more than zero, but is '0 ms'"),
        ("view_range: 0 m", "view_range: must be more than zero"),
        ("view_margin: -1 deg", "view_margin: must not be negative"),
        ("p_min: 1.2", "p_min: must be from 0 to 1, not 1.2"),
        ("relay_time: 0 s", "relay_time: must be more than zero"),
        ("sharing: autoo", "sharing: unknown sharing 'autoo' (did you mean 'auto'?)"),
        ("sharing: {gate: -1 m}", "sharing.gate: must not be negative, but is '-1 m'"),
        ("sharing: {self: -1 m}", "sharing.self: must not be negative, but is '-1 m'"),
        ("sharing: {reach: 0 m}", "sharing.reach: must be more than zero"),
        ("sharing: {seen_within: 0 s}", "sharing.seen_within: must be more than zero"),
        ("sharing: {p_min: 1.2}", "sharing.p_min: must be from 0 to 1, not 1.2"),
    ],
)
def test_what_cannot_be_with_the_recommended_genie_is_refused(settings: str, message: str):
    with pytest.raises(UserError) as error:
        load_scenario("street_1car_homo", [f"methods=[{{method: recommended, {settings}}}]"])
    assert f"methods[0].{message}" in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("genie", ["recommended", "{looks: {}}", "{object_map: {freshness: ttl}}"])
def test_the_papers_genie_has_none_of_them(genie: str):
    with pytest.raises(UserError, match=r"genie\.") as error:
        load_scenario("street_1car_homo", [f"genie={genie}"])
    assert "\n" not in str(error.value)
