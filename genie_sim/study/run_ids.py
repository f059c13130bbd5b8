"""The id of a run that is not described by a scenario alone."""

import hashlib
from functools import cache

from genie_sim.version import PACKAGE_FOLDER


def run_id_of(*decides: object) -> str:
    """A run's id from all that decides its outcome, to which the package's code is added."""
    return hashlib.sha256(repr((_code_digest(), decides)).encode()).hexdigest()[:16]


@cache
def _code_digest() -> str:
    """Of the whole package: a run of other code is another run."""
    digest = hashlib.sha256()
    for path in sorted(PACKAGE_FOLDER.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()
