"""Freshness policies of the paper's Genie, beside the recommended Genie: the study behind
docs/explanation/freshness.md.

    python -m benchmarks.freshness_policies

Declared before it was run: ``3car_hetero`` under seeds 1 to 3, and 4 s of the town ``fleet_30``
under seeds 1 and 2; every policy with its defaults. Nothing is chosen by it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from benchmarks.where_it_pays import design, simulated

OUT = Path("results/freshness/seeds.csv")
POLICIES: dict[str, Any] = {
    "never": "never",
    "ttl": {"name": "ttl", "ttl": "500 ms"},
    "class_ttl": "class_ttl",
    "corroborate": "corroborate",
    "track": "track",
    "autoware": {"name": "existence", "preset": "autoware"},
    "ipda": {"name": "existence", "preset": "ipda"},
    "recommended": "recommended",
}


def entries() -> list[dict[str, Any]]:
    """The methods: the paper's Genie with each policy, and the recommended Genie."""
    paper = [
        {"name": name, "method": "genie", "genie": {"object_map": {"freshness": policy}}}
        for name, policy in POLICIES.items()
    ]
    return [*paper, {"name": "paced", "method": "genie", "genie": "recommended"}]


def main() -> None:
    """Writes every seed's metrics."""
    town = {"scenario": "fleet_30", "perception.duration": "4 s"}
    studies = [
        design({"drive": {}}, entries(), (1, 2, 3)),
        design({"town": town}, entries(), (1, 2)),
    ]
    OUT.parent.mkdir(parents=True, exist_ok=True)
    simulated(studies).to_csv(OUT, index=False)


if __name__ == "__main__":
    main()
