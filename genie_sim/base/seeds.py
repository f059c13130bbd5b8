"""Random numbers by name: every car, link and device has its own.

What unfolds in time, such as when faults happen, draws one number after the other from a
``stream``. What belongs to a frame, such as how long a detector looks at it, has a key (``Draws``):
then one frame has one number, under every method.
"""

import hashlib
from statistics import NormalDist

import numpy as np

_PROBIT = NormalDist().inv_cdf


def stream(root_seed: int, *names: str | int) -> np.random.Generator:
    """The generator named ``names`` under ``root_seed``, for example ``stream(1, "car1",
    "uplink")``.

    It depends on the seed and the names alone: not on the order of calls, not on which other
    streams exist, not on ``PYTHONHASHSEED``. So adding a car changes nobody else's numbers, and all
    methods see the same ones.
    """
    digest = _digest(*names)
    words = [int.from_bytes(digest[i : i + 4], "big") for i in range(0, len(digest), 4)]
    words.insert(0, _checked(root_seed))
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(words)))


class Draws:
    """Random numbers by key. The number of a key depends on the seed, the names and the key alone:
    whoever asks for it, whenever, after whichever others, gets the same one.

    Parameters
    ----------
    root_seed : int
        The seed of the run.
    names : str or int
        What they belong to, as of ``stream``.
    """

    def __init__(self, root_seed: int, *names: str | int) -> None:
        self._hash = hashlib.blake2b(_digest(_checked(root_seed), *names), digest_size=8)

    def uniform(self, key: str) -> float:
        """A number above 0 and below 1, all equally likely."""
        hashed = self._hash.copy()
        hashed.update(key.encode())
        return ((int.from_bytes(hashed.digest(), "big") >> 12) + 0.5) * 2**-52

    def normal(self, key: str) -> float:
        """A standard normal number."""
        return _PROBIT(self.uniform(key))


def _checked(root_seed: int) -> int:
    """The seed. Raises ValueError for a negative one."""
    if root_seed < 0:
        raise ValueError(f"seed {root_seed} is negative")
    return root_seed


def _digest(*names: str | int) -> bytes:
    """32 bytes that tell names apart."""
    # lengths keep ("a", "bc") from ("ab", "c")
    path = "".join(f"{len(text)}:{text}" for text in map(str, names))
    return hashlib.sha256(path.encode()).digest()
