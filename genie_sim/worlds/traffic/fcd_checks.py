"""What is told of floating-car data that was read, and whether it can be: places in metres, times
in seconds, angles in degrees, all vehicles at all steps.
"""

from typing import TYPE_CHECKING

import numpy as np

from genie_sim.base.geometry import Array
from genie_sim.base.import_report import FAST_SHARE, LONG_GAP_S
from genie_sim.base.units import NS_PER_US, duration_text

if TYPE_CHECKING:
    from genie_sim.worlds.traffic.fcd import VehicleRows

SPEEDS = 20_000  # rows whose speed is compared with their way
SAME_SPEED, NO_SPEED = 2.0, 10.0  # how many times as far a vehicle may have gone
JUMP_MPS = 70.0  # assumed: what goes faster from one step to the next has not driven there


def time_text(t_s: float) -> str:
    """A time, in whole microseconds: sums and differences of floats have more digits."""
    return duration_text(round(t_s * 1e6) * NS_PER_US)


def tell(rows: "VehicleRows", duration_s: float) -> None:
    """What was read, for the report."""
    report, persons = rows.report, sum(rows.is_person)
    report.read("vehicles", len(rows.ids) - persons)
    if persons:
        report.read("persons", persons)
    report.span("times", (rows.times_s[0], rows.times_s[-1]), "s")
    known_s = float(rows.times_s[-1]) - rows.begin_s
    if known_s + LONG_GAP_S < duration_s:
        report.warn(
            f"ends {time_text(known_s)} after the beginning, before 'duration' of "
            f"{time_text(duration_s)} is over"
        )
    for name, values in (("x", rows.x_m), ("y", rows.y_m)):
        report.span(name, (values.min(), values.max()), "m")
    report.check_times("steps", rows.times_s.tolist(), "in between vehicles drive straight")


def compare_ways(rows: "VehicleRows", speeds_mps: Array) -> None:
    """Holds angles and speeds against the ways from one step to the next, for the report; persons
    do not count. Raises UserError where they do not fit.
    """
    report = rows.report
    order = np.flatnonzero(~np.array(rows.is_person)[rows.vehicle])[:SPEEDS]
    order = order[np.lexsort((rows.step[order], rows.vehicle[order]))]
    vehicle, t_s = rows.vehicle[order], rows.times_s[rows.step[order]]
    same_vehicle, apart = np.diff(vehicle) == 0, np.diff(rows.step[order])
    usual = np.median(apart[same_vehicle]) if same_vehicle.any() else 1
    if usual > 1:
        report.refuse(
            f"a vehicle is there only at one of {usual:g} steps, and "
            "nowhere in between: write all vehicles at all steps (--device.fcd.period)"
        )
    pairs = same_vehicle & (apart == 1)
    if not pairs.any():
        return
    passed_s = np.diff(t_s)[pairs]
    steps_m = np.column_stack([np.diff(rows.x_m[order]), np.diff(rows.y_m[order])])[pairs]
    report.check_heading(
        "vehicles: angle",
        rows.angle_deg[order][1:][pairs],
        steps_m=steps_m,
        passed_s=passed_s,
        from_north=True,
    )
    way_m = np.hypot(*steps_m.T)
    told_m = passed_s * speeds_mps[order][1:][pairs]
    driven_mps = way_m / passed_s
    # Few are teleports, which are told elsewhere; many are another unit.
    if (driven_mps > JUMP_MPS).mean() <= FAST_SHARE:
        driven_mps = driven_mps[driven_mps <= JUMP_MPS]
    comparable = np.isfinite(told_m) & (way_m <= JUMP_MPS * passed_s)
    if told_m[comparable].sum() > 1.0:
        times = float(way_m[comparable].sum() / told_m[comparable].sum())
        text = f"vehicles go {times:.3g} times as far as their speeds say: is x, y in metres?"
        if not 1 / NO_SPEED < times < NO_SPEED:
            report.refuse(f"{text} (not of --fcd-output.geo, in degrees)")
        elif not 1 / SAME_SPEED < times < SAME_SPEED:
            report.warn(text)
    report.check_speeds("vehicles", driven_mps, float(t_s.max() - t_s.min()))
