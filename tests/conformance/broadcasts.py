"""What every broadcast medium has to keep. One of your own is tested by

@pytest.mark.parametrize("broadcast", [{"medium": "my_module:MyRadio", "range": "50 m"}])
class TestMine(BroadcastConformance):
    pass
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from genie_sim.base.settings import from_plain, plain_data
from genie_sim.core.messages import Effect, Image, Message, Publish
from genie_sim.methods.local import Local
from genie_sim.scenario.scenario import Scenario
from genie_sim.sim.method import LOCAL, HostConfig, HostContext, Interceptor
from tests.conformance import small

TOLD = "/told"
TALKERS = [f"{__name__}:Talker", {"name": "again", "method": f"{__name__}:Talker"}]


class Talker(Local):
    """Local execution, whose answers all hear."""

    title = "talker"

    def on_car(self, host: HostContext) -> HostConfig:
        return HostConfig(
            detector=True, interceptor=lambda *t: Talking(host.name, *t), broadcast=(TOLD,)
        )


class Talking(Interceptor):
    def __init__(self, host: str, subscribed: tuple[str, ...], published: tuple[str, ...]) -> None:
        self.name = f"{host}/talking"
        self._host = host
        (self._images,), (self._objects,) = subscribed, published

    def subscriptions(self) -> tuple[str, ...]:
        return self._images, self._objects + LOCAL, TOLD

    def publications(self) -> tuple[str, ...]:
        return self._objects, self._images + LOCAL, TOLD

    def on_message(
        self, topic: str, message: Message, now_ns: int, sender: str | None = None
    ) -> list[Effect]:
        if isinstance(message, Image):
            return [Publish(self._images + LOCAL, message)]
        if topic == TOLD:
            assert message.header.origin != self._host, "nobody hears its own message"
            assert now_ns > message.header.stamp_ns
            return []
        return [Publish(self._objects, message), Publish(TOLD, message)]


class BroadcastConformance:
    """A broadcast medium, as a scenario writes it."""

    def scenario(self, broadcast: Any, methods: Sequence[Any] = TALKERS) -> Scenario:
        return small.scenario(methods, broadcast=broadcast)

    def test_every_frame_is_answered_or_dropped_and_twice_the_same(self, broadcast: Any):
        written = small.check_twice_the_same(self.scenario(broadcast))
        assert len(written["frames"].to_frame())

    def test_no_state_goes_from_one_method_to_the_next(self, broadcast: Any):
        tables = small.tables(self.scenario(broadcast))
        mine, again = (
            tables["resources"].query(f"method == '{name}'").drop(columns="method")
            for name in ("Talker", "again")
        )
        assert mine.reset_index(drop=True).equals(again.reset_index(drop=True))

    def test_what_is_received_was_sent_to_somebody_else(self, broadcast: Any):
        last = small.tables(self.scenario(broadcast))["resources"].groupby("resource").last()
        sent = last[last.index.str.endswith("->*")]["completed"]
        received = last[last["kind"] == "channel"][["completed", "dropped"]].to_numpy().sum()
        assert sent.sum() > 0 and received <= sent.sum() * (len(sent) - 1)

    def test_it_is_written_down_as_it_was_read(self, broadcast: Any):
        scenario = self.scenario(broadcast)
        assert from_plain(type(scenario), plain_data(scenario)) == scenario
