"""Local execution (L): every car's own detector answers its frames."""

from genie_sim.sim.method import HostConfig, HostContext, Method


class Local(Method):
    """Each car runs its own detector."""

    title = "local (L)"
    baseline = True

    def on_car(self, host: HostContext) -> HostConfig | None:
        return HostConfig(detector=True) if host.gets_images else None
