"""A table of frames around an outage."""

from __future__ import annotations

import pandas as pd

from genie_sim.record.columns import Columns


def table(rows: list[tuple], *names: str) -> Columns:
    frame = pd.DataFrame(rows, columns=list(names))
    return Columns.of(
        frame.astype(
            {
                name: "category"
                for name in names
                if frame[name].dtype == object and name[-2:] != "ns"
            }
        )
    )
