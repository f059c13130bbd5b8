"""Random stories told to a Genie: requests of its client and of neighbours, answers from anywhere,
and time.
"""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from hypothesis import strategies as st

from genie_sim.core.messages import Detection, Detections, Effect, Header, Image
from genie_sim.core.node import GenieNode
from tests.core.worlds import IMAGES, OBJECTS
from tests.make import BRIDGE, CROSSING, S, answer, frame, seen

NEIGHBOURS = ("edge2/genie", "edge3/genie")
UNHEARD_OF = Header(999 * S, "02", "car9")

# Some of these are within a metre of each other, across cells too; no two distances between them
# are equal.
PLACES = (
    (None,),
    (20.0, 0.0),
    (20.7, 0.1),
    (21.3, -0.2),
    (19.9, 0.75),
    (25.0, 30.0),
    (470.0, 3.0),
    (520.0, -4.0),
)


ASKS, NEIGHBOUR_ASKS, ASKS_AGAIN = "client asks", "neighbour asks", "neighbour asks again"
NODE_ANSWERS, NEIGHBOUR_ANSWERS = "node answers", "neighbour answers"
EVENTS = (
    [ASKS] * 3 + [NEIGHBOUR_ASKS] * 2 + [ASKS_AGAIN] + [NODE_ANSWERS] * 3 + [NEIGHBOUR_ANSWERS] * 2
)


class Step(NamedTuple):
    """A message that comes at an instant."""

    now_ns: int
    topic: str
    message: Image | Detections
    sender: str


def stories(shared_stamps: bool = False) -> st.SearchStrategy[list[Step]]:
    """Stories of up to 30 messages. A failing one is cut to where it first fails."""
    return st.builds(
        lambda seed, length: story(seed, shared_stamps)[:length],
        st.integers(0, 9_999),
        st.integers(10, 30),
    )


def story(seed: int, shared_stamps: bool) -> list[Step]:
    """No client sends a frame twice; a neighbour's request may come over two ways. Most answers
    belong to a request.

    ``shared_stamps``: two cameras and two cars take their frames at the same instants.
    """
    rng = random.Random(seed)
    now_ns, asked, neighbours_asked, story = 0, [], [], []
    for number in range(30):
        now_ns += rng.choice([0, S // 10, S // 10, S // 2, 2 * S])
        event, place, neighbour = (
            rng.choice(EVENTS),
            rng.choice([CROSSING, BRIDGE]),
            rng.choice(NEIGHBOURS),
        )
        stamp_s, camera = (number // 2, f"0{2 + number % 2}") if shared_stamps else (number, "02")
        if event == ASKS:
            topic, message, sender = IMAGES, frame(stamp_s, place, "car1", camera), "car1/genie"
            asked.append(message.header)
        elif event == ASKS_AGAIN and neighbours_asked:
            topic, message, sender = f"{IMAGES}-remote", neighbours_asked[-1], neighbour
        elif event in (NEIGHBOUR_ASKS, ASKS_AGAIN):
            topic, message, sender = (
                f"{IMAGES}-remote",
                frame(stamp_s, place, "car2", camera),
                neighbour,
            )
            asked.append(message.header)
            neighbours_asked.append(message)
        else:
            sender, direction = (
                ("edge1/detector", "local") if event == NODE_ANSWERS else (neighbour, "remote")
            )
            request = rng.choice([UNHEARD_OF, *asked[-3:]])
            topic, message = f"{OBJECTS}-{direction}", answer(request, *findings(rng), by=sender)
        story.append(Step(now_ns, topic, message, sender))
    return story


def findings(rng: random.Random) -> list[Detection]:
    """What a detector says about a picture."""
    return [
        seen(*rng.choice(PLACES), label=rng.choice(["car", "person"]), score=round(rng.random(), 2))
        for _ in range(rng.randrange(4))
    ]


class Told(NamedTuple):
    """A step of a story and what the Genie did."""

    step: Step
    effects: Sequence[Effect]


def tell(genie: GenieNode, story: Sequence[Step], timer: bool = True) -> Iterator[Told]:
    """Tells the story. With ``timer`` the Genie is woken at its deadlines too; the end of time
    comes in any case.
    """
    for step in (*story, Step(10_000 * S, "", answer(UNHEARD_OF), "")):
        while (
            timer
            and (deadline_ns := genie.next_deadline_ns()) is not None
            and deadline_ns <= step.now_ns
        ):
            yield Told(Step(deadline_ns, "", step.message, ""), genie.on_deadline(deadline_ns))
        if step.topic:
            yield Told(step, genie.on_message(step.topic, step.message, step.now_ns, step.sender))
    yield Told(step, genie.on_deadline(step.now_ns))
