"""Which sources decided the numbers of an evaluation, as digests, and whether a set-up is still the
paper's.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from genie_sim.base import files
from genie_sim.base.paths import sha256_of
from genie_sim.base.settings import plain_data
from genie_sim.paper.checks import ALL, CASE
from genie_sim.scenario.reading import load_scenario
from genie_sim.version import PACKAGE_FOLDER

SET_UPS = (*ALL, CASE)
TRACE = "kitti_0005"
HERE = Path(__file__).parent
ASSUMPTIONS = HERE / "assumptions.yaml"
# what says what is run and tested
INPUTS = (ASSUMPTIONS, HERE / "claims.yaml", HERE / "table1.yaml")
NO_SET_UP = ("name", "description", "seed", "methods", "record")  # what any run may choose


def digests() -> dict[str, str]:
    """A digest of each kind of source: what is equal gives equal numbers, on the same versions of
    the packages.
    """
    traces = files.find(files.TRACE, TRACE).parent.glob(f"{TRACE}*.parquet")
    paths_by_kind = {
        "package": PACKAGE_FOLDER.rglob("*.py"),
        "scenarios": [files.find(files.SCENARIO, name) for name in SET_UPS],
        "device_profiles": files.available(files.DEVICE).values(),
        "traces": traces,
    }
    return {kind: _digest(paths) for kind, paths in paths_by_kind.items()}


def _digest(paths: Iterable[Path]) -> str:
    """Of files with their names, whatever their order."""
    file_digests = sorted((path.name, sha256_of(path)) for path in paths)
    return hashlib.sha256(json.dumps(file_digests).encode()).hexdigest()


def changed_setting(scenario: Mapping[str, Any]) -> str | None:
    """A setting in which a run's scenario, as plain data, is not the shipped one of its name;
    ``None`` where it is that, whatever its seed and its methods.
    """
    shipped = plain_data(load_scenario(str(scenario["name"])))
    keys: set[str] = {*scenario, *shipped} - {*NO_SET_UP}
    for key in sorted(keys):
        ours, theirs = (
            json.dumps(settings.get(key), default=str) for settings in (scenario, shipped)
        )
        if ours != theirs:
            return key
    return None
