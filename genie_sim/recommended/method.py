"""The Genie that this project recommends, as a method (docs/explanation/looks.md).

Every frame is answered at once, out of a map of tracks. Looks, the passes of a detector over one
frame, are a flow of their own: they go up at a pace, none is stored, and what an edge's detector
answers goes back directly. Where all cars are in one world, a Genie beside each edge's detector
shares with them what others saw. Its numbers were chosen on drives that no test uses.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Literal

from genie_sim.base.errors import UserError
from genie_sim.base.marks import Bounds, Count, Share
from genie_sim.core.messages import Detections
from genie_sim.core.node import MakeAnswer
from genie_sim.recommended.paced_genie import PacedGenie
from genie_sim.recommended.pacing import Pacer
from genie_sim.recommended.shared_tracks import SharedTracks, SharingRules
from genie_sim.recommended.sharing_genie import SharingGenie
from genie_sim.sim.method import (
    DIRECT_UPLINK,
    LOCAL,
    OBJECTS,
    REMOTE,
    REMOTE_UPLINK,
    Costs,
    HostConfig,
    HostContext,
    Method,
)
from genie_sim.tracks.existence import ExistenceFilter
from genie_sim.tracks.laws import ASSUMED, DetectorLaws
from genie_sim.tracks.track_map import TrackMap


@dataclass(frozen=True)
class Recommended(Method):
    """Cars answer out of a map of tracks, look at a pace, and get from their edge what others
    see.
    """

    title = "recommended Genie"

    every_ns: int = 75_000_000
    """Mean time between the frames of a view that go up, or between all of its frames where that is
    longer; the frame nearest to the instant at which a look is due goes up. Streams whose headings
    differ by less than 15 degrees show one view and take turns."""

    in_flight: Count = 4
    """At most this many frames of a car are on their way to the edge and back."""

    stale_ns: Annotated[int, Bounds(above=0)] = 500_000_000
    """An answer about an older frame is no look. While the round trip is longer than this, only one
    frame is on its way; with each such answer in a row the time between looks grows: to this time,
    then twice as long each time, up to 10 s."""

    view_range_m: Annotated[float, Bounds(above=0)] = 50.0
    """Answers out of the map reach this far."""

    view_margin_rad: Annotated[float, Bounds(minimum=0)] = math.radians(10.0)
    """Answers out of the map are this much wider than the camera's view, on each side."""

    p_min: Share = 0.8
    """The map believes in what exists with at least this probability; only that is answered."""

    tau_ns: int = 100_000_000
    """Looks within this time are no independent evidence; 0 weighs every look in full."""

    measured: bool = True
    """Whether detection probability and score distributions are those that were measured for the
    detector on other drives, or assumed."""

    sharing: SharingRules | Literal["auto"] | None = "auto"
    """What a Genie beside each edge's detector tells a car of the objects that other cars saw;
    `null`: nothing. Only where all cars are in one world at one time; `auto`: as by default there,
    else nothing."""

    relay_time_ns: Annotated[int, Bounds(above=0)] | None = 236_000
    """CPU time of a message that a Genie only relays or learns from; an answer of its own making
    costs the Genie time of the device profile. Measured in real ROS on an x86 processor
    (reality.md of genie-sim-ros). `null`: every message costs the Genie time."""

    def on_car(self, host: HostContext) -> HostConfig | None:
        if not host.gets_images and self._sharing(host) is None:
            raise UserError(
                f"recommended: {host.name}: a car without cameras lives on what edges share: it "
                "needs 'sharing'"
            )
        if not host.gets_images:
            return HostConfig(uplink=DIRECT_UPLINK)
        if host.genie is None:
            return HostConfig(detector=True)
        return HostConfig(
            detector=True,
            interceptor=partial(self._car_interceptor, host),
            uplink=REMOTE_UPLINK if host.has_edge else None,
            costs=Costs(relay_time_ns=self.relay_time_ns),
        )

    def on_edge(self, host: HostContext) -> HostConfig:
        if self._sharing(host) is None:
            return HostConfig(detector=host.gets_images)
        return HostConfig(
            detector=host.gets_images,
            interceptor=partial(self._edge_interceptor, host),
            neighbour_topics=(OBJECTS + REMOTE,),
            costs=Costs(relay_time_ns=self.relay_time_ns),
            is_beside=host.gets_images,
        )

    def _car_interceptor(
        self, host: HostContext, inputs: Sequence[str], outputs: Sequence[str]
    ) -> PacedGenie:
        return self.car_genie(
            f"{host.name}/genie",
            inputs,
            outputs,
            has_edge=host.has_edge,
            object_map=self.new_map(host.laws),
            sharing=self._sharing(host),
            names_changes=host.names_changes,
        )

    def car_genie(
        self,
        name: str,
        inputs: Sequence[str],
        outputs: Sequence[str],
        *,
        has_edge: bool,
        object_map: TrackMap,
        sharing: SharingRules | None = None,
        make_answer: MakeAnswer = Detections,
        suffixes: tuple[str, str] = (LOCAL, REMOTE),
        names_changes: bool = True,
    ) -> PacedGenie:
        """The Genie of a car; the arguments are those of ``PacedGenie``."""
        pacer = Pacer(every_ns=self.every_ns, in_flight=self.in_flight, stale_ns=self.stale_ns)
        return PacedGenie(
            name,
            inputs,
            outputs,
            pacer=pacer if has_edge else None,
            object_map=object_map,
            shared_tracks=None if sharing is None else SharedTracks(sharing, object_map),
            make_answer=make_answer,
            suffixes=suffixes,
            names_changes=names_changes,
        )

    def _edge_interceptor(
        self, host: HostContext, inputs: Sequence[str], outputs: Sequence[str]
    ) -> SharingGenie:
        rules = self._sharing(host)
        assert rules is not None
        return SharingGenie(
            f"{host.name}/genie",
            inputs,
            outputs,
            object_map=self.new_map(host.laws),
            rules=rules,
            make_answer=Detections,
            answers_frames=not host.gets_images,
            names_changes=host.names_changes,
        )

    def new_map(self, laws: DetectorLaws = ASSUMED) -> TrackMap:
        """An empty map of tracks; ``laws`` are those that were measured."""
        return TrackMap(
            ExistenceFilter(self.p_min, self.tau_ns, laws if self.measured else ASSUMED),
            view_range_m=self.view_range_m,
            view_margin_rad=self.view_margin_rad,
        )

    def _sharing(self, host: HostContext) -> SharingRules | None:
        """What edges share. Raises ``UserError`` where others cannot see what one car sees."""
        if self.sharing == "auto":
            return SharingRules() if host.is_one_world else None
        if self.sharing is not None and not host.is_one_world:
            raise UserError(
                "recommended: sharing: cars replay recordings at different times, so what one sees "
                "is not there for others; leave it out, or use a town or recordings of one sequence"
            )
        return self.sharing
