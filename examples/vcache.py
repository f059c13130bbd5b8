"""vCache: a similarity cache that bounds the share of wrong answers (L. G. Schroeder and others,
ICLR 2026, arXiv 2502.03771).

What is known of an answer are *explorations*: the detector ran although the answer was stored; how
similar were the images, and were the answers the same? A logistic law of the similarity is fitted
to them. A request is explored with the smallest probability with which, even at the pessimistic
end of the law, no more than ``delta`` of the requests are answered wrongly; otherwise the nearest
answer is replayed. What an exploration finds is stored only if it differs.

Here the similarity is the cosine of images' features, and two answers are the same if their objects
agree with an F1 of at least 0.8, as in the metric ``wrong_hit_share``. ``shared``: one law for all
answers of a cache; as published each answer has its own. Two things differ from the authors' code:
it cuts the threshold of a law off at 1, which breaks the bound where even the most similar images
seldom have one answer; and where a threshold separates all explorations it looks the variance up in
a table, which is here ``0.2 / n``, at least 0.01, near theirs.
"""

import math
from collections.abc import Hashable
from dataclasses import dataclass
from statistics import NormalDist

from genie_sim.extend import (
    HITS,
    LOWER,
    LRU,
    Answer,
    Capacity,
    Columns,
    Draws,
    FeatureKey,
    HostContext,
    Metric,
    Replay,
    Sample,
    Share,
    SimilarityCache,
    SimilarityCaching,
    are_same,
    frame_key,
    is_wrong,
    share_of,
)

ENOUGH = 6  # observations from which on a law is fitted
CONFIDENCES = [1 - (1e-6 + (1 - 2e-6) * step / 49) for step in range(50)]
QUANTILES = [NormalDist().inv_cdf(confidence) for confidence in CONFIDENCES]
REMEMBERED = 1000  # explorations that may wait for their answers


class Law:
    """How likely the stored answer is right, by similarity. It begins with two observations, which
    count: nothing alike has another answer, and everything alike has the same.
    """

    def __init__(self) -> None:
        self._seen = {0.0: [1, 0], 1.0: [0, 1]}  # by similarity: how many differed, were the same
        self._fit: tuple[float, float, float] | None = None  # threshold, steepness, deviation

    def observe(self, similarity: float, was_same: bool) -> None:
        """Adds an exploration."""
        self._seen.setdefault(similarity, [0, 0])[was_same] += 1
        self._fit = None

    def explore(self, similarity: float, delta: float) -> float:
        """The least probability of exploring that keeps the share of wrong answers at ``delta``;
        0 or less: never.
        """
        if sum(map(sum, self._seen.values())) < ENOUGH:
            return 1.0
        if self._fit is None:
            self._fit = self._fitted()
        threshold, steepness, deviation = self._fit
        probabilities = []
        for confidence, quantile in zip(CONFIDENCES, QUANTILES, strict=True):
            pessimistic = threshold + quantile * deviation
            right = confidence * _logistic(steepness * (similarity - pessimistic))
            probabilities.append(1 - delta / (1 - right))
        return min(probabilities)

    def _fitted(self) -> tuple[float, float, float]:
        """Logistic regression by Newton's method, and the deviation of its threshold."""
        a = b = 0.0
        for _ in range(50):
            rise_a = rise_b = aa = ab = bb = 0.0
            for s, (differed, agreed) in self._seen.items():
                likely = _logistic(a + b * s)
                over = agreed - (differed + agreed) * likely
                weight = (differed + agreed) * likely * (1 - likely)
                rise_a, rise_b = rise_a + over, rise_b + over * s
                aa, ab, bb = aa + weight, ab + weight * s, bb + weight * s * s
            determinant = aa * bb - ab * ab
            if max(abs(rise_a), abs(rise_b)) < 1e-8 or determinant <= 0:
                break
            step_a = (bb * rise_a - ab * rise_b) / determinant
            step_b = (aa * rise_b - ab * rise_a) / determinant
            before, length = self._log_likelihood(a, b), 1.0
            while self._log_likelihood(a + length * step_a, b + length * step_b) < before - 1e-9:
                length /= 2
            a, b = a + length * step_a, b + length * step_b
        steepness = max(b, 1e-6)
        threshold = -a / steepness
        lowest_same = min(s for s, (_, agreed) in self._seen.items() if agreed)
        if lowest_same > max(s for s, (differed, _) in self._seen.items() if differed):
            count = sum(map(sum, self._seen.values()))
            return threshold, steepness, math.sqrt(max(0.2 / count, 0.01))
        to_a, to_b = -1 / steepness, a / steepness**2  # delta method
        variance = (to_a**2 * bb - 2 * to_a * to_b * ab + to_b**2 * aa) / determinant
        return threshold, steepness, math.sqrt(max(variance, 0.0))

    def _log_likelihood(self, a: float, b: float) -> float:
        return sum(
            agreed * (a + b * s) - (differed + agreed) * _softplus(a + b * s)
            for s, (differed, agreed) in self._seen.items()
        )


def _logistic(x: float) -> float:
    return (1 + math.tanh(x / 2)) / 2


def _softplus(x: float) -> float:
    return max(x, 0.0) + math.log1p(math.exp(-abs(x)))


class VerifiedCache(SimilarityCache):
    """A hit is the nearest stored key, unless it is explored. No request waits for the answer to
    another, which nobody would verify.

    Parameters
    ----------
    capacity : Capacity or None
        A limit in entries or bytes; ``None``: no limit.
    draws : Draws
        Say which frames are explored.
    delta : float
        The share of wrong answers that is allowed.
    shared : bool
        Whether all keys have one law.
    replay : {"camera", "world"}
        Where the objects of a replayed answer are.
    """

    def __init__(
        self,
        capacity: Capacity | None,
        draws: Draws,
        *,
        delta: float,
        shared: bool,
        replay: Replay = "camera",
    ) -> None:
        super().__init__(LRU(), capacity, replay)
        self._draws, self._delta, self._shared = draws, delta, shared
        self._laws: dict[FeatureKey | None, Law] = {}
        # explored requests: the nearest key and its similarity; None where it had the same answer
        self._explored: dict[Hashable, tuple[FeatureKey, float] | None] = {}

    def law(self, key: FeatureKey) -> Law:
        """That of a stored key."""
        return self._laws.setdefault(None if self._shared else key, Law())

    def choose(self, key: FeatureKey, now_ns: int) -> FeatureKey | None:
        nearest = self.near(key, 1, now_ns)
        if not nearest:
            return None
        distance, stored = nearest[0]
        similarity = max(round(1 - distance**2 / 2, 3), 0.0)
        probability = self.law(stored).explore(similarity, self._delta)
        if self._draws.uniform(frame_key(key.header)) > probability:
            return stored
        self._explored[key] = stored, similarity
        if len(self._explored) > REMEMBERED:
            del self._explored[next(iter(self._explored))]
        return None

    def put(self, key: Hashable, topic: str, answer: Answer, now_ns: int) -> None:
        if key in self._explored:
            assert isinstance(key, FeatureKey)
            explored = self._explored.pop(key)
            if explored is None or self._was_same(key, answer, *explored):
                self._explored[key] = None  # a second answer is not stored, either
                return
        super().put(key, topic, answer, now_ns)

    def _was_same(
        self, key: FeatureKey, answer: Answer, stored: FeatureKey, similarity: float
    ) -> bool:
        """Learns from an exploration; what was evicted meanwhile teaches nothing."""
        if stored not in self.answers:
            return False
        was_same = are_same(self.objects_of([answer], key.pose), self.stored_objects(stored))
        self.law(stored).observe(similarity, was_same)
        return was_same

    def remove(self, key: Hashable) -> None:
        super().remove(key)
        if isinstance(key, FeatureKey):
            self._laws.pop(key, None)


@dataclass(frozen=True, kw_only=True)
class VCache(SimilarityCaching):
    """vCache: an answer is replayed as often as a bound on the wrong ones allows."""

    title = "vCache"

    delta: Share = 0.1
    """The largest share of wrong answers among the replayed ones."""

    shared: bool = False
    """Whether all stored answers have one law, or each its own."""

    def cache(self, host: HostContext, capacity: Capacity | None) -> SimilarityCache:
        return VerifiedCache(
            capacity,
            host.draws("vcache"),
            delta=self.delta,
            shared=self.shared,
            replay=self.replay,
        )


def wrong(answers: Columns) -> Sample:
    """Of the results those from a cache that are wrong."""
    results = answers.where(which="result")
    return share_of(results, is_wrong(results) & results["source"].isin(HITS["all"]))


wrong_replays = Metric(
    "wrong replays",
    "%",
    LOWER,
    meaning="Share of all answers that come from a cache and have an F1 below 80 % against the "
    "detector's own answer to the same frame.",
    formula=wrong,
    kind="answers",
)
