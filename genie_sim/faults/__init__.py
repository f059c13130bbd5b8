"""Faults: what goes wrong in a run, one file each (``sim.fault.Fault``), found by name here or as
``package.module:Class``. It may import ``base``, ``core`` and ``sim``.
"""

FAULTS: dict[str, str] = {
    "outage": "genie_sim.faults.outage:Outage",
    "hand_over": "genie_sim.faults.hand_over:HandOver",
    "crash": "genie_sim.faults.crash:Crash",
    "stall": "genie_sim.faults.stall:Stall",
    "slow": "genie_sim.faults.slow:Slow",
    "partition": "genie_sim.faults.partition:Partition",
    "gnss": "genie_sim.faults.gnss:Gnss",
    "camera": "genie_sim.faults.camera:CameraFault",
}
MUST_HAVE = ("strike",)
