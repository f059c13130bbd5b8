"""What a method is that says no more than it must."""

from genie_sim.sim.method import Costs, HostConfig, Method


class Plain(Method):
    title = "plain"


def test_a_method_is_no_baseline_unless_it_says_so():
    assert Plain().baseline is False


def test_what_a_host_runs_unless_it_is_said():
    config = HostConfig()
    assert not config.detector and config.interceptor is None and config.uplink is None
    assert config.neighbour_topics == () and not config.is_beside
    assert config.costs == Costs(is_free=False, key=None, per_entry_ns=0, relay_time_ns=None)
