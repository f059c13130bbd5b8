"""Readings of Algorithm 1: what the paper leaves open, a small function or class for each choice.

``node`` shows the algorithm as a Genie runs it by default. Where the paper allows another reading
it calls a function of ``Readings``; which one is chosen once, when the Genie is made
(``genies.make_genie``). The reading that needs an algorithm of its own is in ``per_topic``.
"""

from collections.abc import Callable, Hashable
from dataclasses import dataclass

from genie_sim.core.maps import EnhancedAnswer
from genie_sim.core.message_cache import PendingIndex, PendingRequest
from genie_sim.core.messages import Answer, Header
from genie_sim.core.rules import GenieRules
from genie_sim.core.similarity import KeyIndex

# Of the stored and a later answer to one request: what is stored from now on.
SecondAnswer = Callable[[Answer, Answer], Answer]
# Which header a replay carries: of the request's and the stored answer's.
ReplayHeader = Callable[[Header, Header], Header]
# Which part of an answer somebody gets.
Part = Callable[[EnhancedAnswer], Answer]


def overwrite(stored: Answer, later: Answer) -> Answer:
    """``second_answer: overwrite``: the later answer takes the place of the first. The default."""
    return later


def first_wins(stored: Answer, later: Answer) -> Answer:
    """``second_answer: first_wins``: the first answer stays."""
    return stored


def merge(stored: Answer, later: Answer) -> Answer:
    """``second_answer: merge``: objects of new classes or places are added to the first answer."""
    if stored.objects is None or later.objects is None:
        return later
    places = {(detection.label, detection.location) for detection in stored.objects}
    added = [
        detection
        for detection in later.objects
        if (detection.label, detection.location) not in places
    ]
    return stored.with_objects([*stored.objects, *added])


def of_the_request(request: Header, stored: Header) -> Header:
    """``replay_stamp: request``: a replay is an answer to its request. The default."""
    return request


def of_the_stored_answer(request: Header, stored: Header) -> Header:
    """``replay_stamp: stored``: a replay keeps the header of the request that it first answered."""
    return stored


def for_clients(answer: EnhancedAnswer) -> Answer:
    """Confident objects only."""
    return answer.to_clients


def for_neighbours(answer: EnhancedAnswer) -> Answer:
    """Confident objects only, as other Genies may have them."""
    return answer.to_neighbours


def all_objects(answer: EnhancedAnswer) -> Answer:
    """All objects, whatever their confidence."""
    return answer.answer


@dataclass(frozen=True, slots=True)
class Readings:
    """How one Genie reads Algorithm 1. Without arguments: the default readings."""

    second_answer: SecondAnswer = overwrite
    """What is stored when a second answer to a request comes."""

    replay_header: ReplayHeader = of_the_request
    """The header of a replayed answer."""

    part_for_own_host: Part = for_clients
    """What clients on the Genie's own host get of what the encapsulated node finds."""

    part_for_neighbours: Part = for_neighbours
    """What other Genies get."""

    learns_from_others: bool = True
    """Whether answers of other Genies are stored, or just go on to clients."""

    runs_neighbours_misses: bool = False
    """Whether a neighbour's request that misses is treated as a client's, or not run at all."""

    answers_misses: bool = True
    """Whether a client whose request missed gets the detection when it is ready."""


DEFAULT_READINGS = Readings()


def readings_of(rules: GenieRules) -> Readings:
    """The readings that the settings of a Genie choose."""
    second_answers: dict[str, SecondAnswer] = {
        "overwrite": overwrite,
        "first_wins": first_wins,
        "merge": merge,
    }
    return Readings(
        second_answer=second_answers[rules.second_answer],
        replay_header=of_the_stored_answer if rules.replay_stamp == "stored" else of_the_request,
        part_for_own_host=all_objects if rules.fresh_objects == "all" else for_clients,
        part_for_neighbours=all_objects if rules.share_filter == "all" else for_neighbours,
        learns_from_others=rules.car_learns == "all",
        runs_neighbours_misses=rules.neighbour_miss == "process",
        answers_misses=rules.miss_policy != "hits_only",
    )


class ForwardingIndex(PendingIndex):
    """``same_key_pending: forward``: a request equal to a pending one is run again."""

    def joinable(self, topic: str, key: Hashable) -> PendingRequest | None:
        return None


def pending_index(rules: GenieRules, new_keys: Callable[[], KeyIndex]) -> PendingIndex:
    """The empty index of pending requests that the settings of a Genie choose."""
    identity = _stamp if rules.header_identity == "stamp" else None
    if rules.same_key_pending == "forward":
        return ForwardingIndex(identity, new_keys)
    return PendingIndex(identity, new_keys)


def _stamp(header: Header) -> int:
    return header.stamp_ns
