"""Random numbers by name: every car, link and device draws from a generator of its own."""

import hashlib

import numpy as np


def stream(root_seed: int, *names: str | int) -> np.random.Generator:
    """The generator named ``names`` under ``root_seed``, for example ``stream(1, "car1",
    "uplink")``.

    It depends on the seed and the names alone: not on the order of calls, not on which other
    streams exist, not on ``PYTHONHASHSEED``. So adding a car changes nobody else's numbers, and all
    methods see the same ones.
    """
    if root_seed < 0:
        raise ValueError(f"seed {root_seed} is negative")
    # lengths keep ("a", "bc") from ("ab", "c")
    path = "".join(f"{len(text)}:{text}" for text in map(str, names))
    digest = hashlib.sha256(path.encode()).digest()
    words = [int.from_bytes(digest[i : i + 4], "big") for i in range(0, len(digest), 4)]
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([root_seed, *words])))
