"""Generates the recording of round trips that is shipped: `python -m tools.make.urban_n78`.

It is no measurement. The quantiles are those of CICV5G's urban drives on n78, 152,000 round trips
from a car to a cloud and back at up to 100 Hz (zxr805/CICV5G, commit ea215aa9, CC BY 4.0); the
correlation from one round trip to the next, the smallest and the largest are assumed.
"""

from pathlib import Path
from statistics import NormalDist

import numpy as np

from genie_sim.base.seeds import stream
from genie_sim.links import recording

OUT = Path(__file__).resolve().parents[2] / "scenarios/links/urban_n78_generated.parquet"
INTERVAL_NS, ROWS = 50_000_000, 2400  # 20 Hz for two minutes
CORRELATION = 0.8  # of one row and the next; assumed
PROBABILITIES = (0.0, 0.5, 0.95, 0.99, 0.999, 1.0)
QUANTILES_MS = (12.0, 16.0, 24.0, 29.0, 217.0, 300.0)  # the first and the last are assumed
ABOUT = {
    "made_by": "python -m tools.make.urban_n78",
    "source": "generated from quantiles of zxr805/CICV5G @ ea215aa9, urban n78; not a measurement",
    "licence": "Apache-2.0",
}


def columns() -> dict[str, list[int]]:
    """A normal process whose correlation falls by the same factor from row to row, with each value
    replaced by the quantile of the same probability.
    """
    rng, probability = stream(78, "urban n78"), NormalDist().cdf
    innovations = rng.standard_normal(ROWS)
    value, rtt_ns = float(innovations[0]), []
    for innovation in innovations:
        value = CORRELATION * value + (1 - CORRELATION**2) ** 0.5 * float(innovation)
        rtt_ms = float(np.interp(probability(value), PROBABILITIES, QUANTILES_MS))
        rtt_ns.append(round(rtt_ms * 1000) * 1000)
    return {"t_ns": [row * INTERVAL_NS for row in range(ROWS)], "rtt_ns": rtt_ns}


if __name__ == "__main__":
    recording.write(OUT, columns(), ABOUT)
    print(OUT)
