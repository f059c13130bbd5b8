"""Faults: what goes wrong in a run. One file each, found by name here or as ``package.module:Class``.

A fault imports ``sim`` and says what begins and what ends (``sim.fault.Fault``); its arguments are its settings.
"""

FAULTS: dict[str, str] = {
    "outage": "genie_sim.faults.outage:Outage",
    "hand_over": "genie_sim.faults.hand_over:HandOver",
}
MUST_HAVE = ("begin", "end")
