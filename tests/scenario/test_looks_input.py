"""Paced looks that cannot be: each in one line that names the field, the value and the choices."""

from __future__ import annotations

from typing import Any

import pytest

from genie_sim.errors import UserError
from genie_sim.scenario.scenario import load_scenario

NO_EFFECT = "has no effect with 'looks', which keep no answers"
TRACKS = "'never' does not track, which 'looks' need; known: track, existence, recommended"


@pytest.mark.parametrize(
    ("genie", "message"),
    [
        ("eviction: lru", f"eviction: {NO_EFFECT}"),
        ("ttl: 10 s, eviction: ttl", f"eviction: {NO_EFFECT}"),
        ("capacity: 9 entries", f"capacity: {NO_EFFECT}"),
        ("car_capacity: 9 entries", f"car_capacity: {NO_EFFECT}"),
        ("same_key_pending: forward", f"same_key_pending: {NO_EFFECT}"),
        ("second_answer: merge", f"second_answer: {NO_EFFECT}"),
        ("miss_policy: blocking", "miss_policy: must be 'immediate' with 'looks'"),
        ("object_map: {freshness: never}", f"object_map.freshness: {TRACKS}"),
        ("edge: behind", "edge: unknown field"),
        ("looks: {every: -1 ms}", "looks.every: must not be negative, but is '-1 ms'"),
        ("looks: {in_flight: 0}", "looks.in_flight: must be at least 1, not 0"),
        ("looks: {stale: 0 ms}", "looks.stale: must be more than zero, but is '0 ms'"),
        ("looks: {own: some}", "looks.own: unknown own 'some'; known: all, free, rest"),
        ("looks: {view_margin: -1 deg}", "looks.view_margin: must not be negative"),
        ("looks: {told: autoo}", "looks.told: unknown told 'autoo' (did you mean 'auto'?)"),
        ("looks: {told: {gate: -1 m}}", "looks.told.gate: must not be negative, but is '-1 m'"),
        ("looks: {told: {self: -1 m}}", "looks.told.self: must not be negative, but is '-1 m'"),
        ("looks: {told: {reach: 0 m}}", "looks.told.reach: must be more than zero"),
        ("looks: {told: {fresh: 0 s}}", "looks.told.fresh: must be more than zero"),
        ("looks: {told: {p_min: 1.2}}", "looks.told.p_min: must be from 0 to 1, not 1.2"),
        ("looks: {told: {gate: 2 m}}", "looks.told: cars replay recordings at different times"),
    ],
)
def test_what_cannot_be_with_paced_looks_is_refused(genie: str, message: str):
    entry = f"{{name: paced, method: genie, genie: {{algorithm: recommended, {genie}}}}}"
    refused(f"methods=[{entry}]", f"methods[0].genie.{message}")


def test_the_time_to_pass_a_message_on_needs_looks():
    refused("genie.pass_time=1 ms", "genie.pass_time: has no effect without 'looks'")


def refused(override: str, message: str) -> Any:
    with pytest.raises(UserError) as error:
        load_scenario("1car_homo", [override])
    assert message in str(error.value) and "\n" not in str(error.value)
