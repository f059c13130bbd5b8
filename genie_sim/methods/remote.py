"""Remote execution (R): the detector on the edge server answers every frame."""

from genie_sim.sim.method import DIRECT_UPLINK, HostConfig, HostContext, Method


class Remote(Method):
    """Each car's frames go to its edge's detector."""

    title = "remote (R)"
    baseline = True

    def on_car(self, host: HostContext) -> HostConfig | None:
        if not host.gets_images:
            return None
        return HostConfig(uplink=DIRECT_UPLINK if host.has_edge else None)
