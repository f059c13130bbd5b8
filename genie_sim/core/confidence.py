"""How a repeated sighting changes the confidence of a stored object (Algorithm 2, line 5).

Each rule maps the stored confidence C, the sighting's confidence M.C and the rate lambda, all in
[0, 1], to the new stored confidence in [0, 1].
"""

from collections.abc import Callable

ConfidenceRule = Callable[[float, float, float], float]
"""Of ``confidence`` (C), that of the ``sighting`` (M.C) and ``rate`` (lambda) the new C."""


def noisy_or(confidence: float, sighting: float, rate: float) -> float:
    """``C += lambda * M.C * (1 - C)``: sightings add up and never pass 1. The default."""
    return confidence + rate * sighting * (1.0 - confidence)


def literal(confidence: float, sighting: float, rate: float) -> float:
    """``C += lambda * (C - M.C)`` as printed: a stronger sighting lowers the confidence. Clamped to
    [0, 1].
    """
    return min(1.0, max(0.0, confidence + rate * (confidence - sighting)))


def ema(confidence: float, sighting: float, rate: float) -> float:
    """``C += lambda * (M.C - C)``: the exponential moving average of the sightings."""
    return confidence + rate * (sighting - confidence)


def positive_part(confidence: float, sighting: float, rate: float) -> float:
    """``C += lambda * max(M.C - C, 0)``: stronger sightings raise the confidence, weaker ones leave
    it.
    """
    return confidence + rate * max(sighting - confidence, 0.0)


CONFIDENCE_RULES: dict[str, ConfidenceRule] = {
    "noisy_or": noisy_or,
    "literal": literal,
    "ema": ema,
    "positive_part": positive_part,
}
