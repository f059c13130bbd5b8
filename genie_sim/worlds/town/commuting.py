"""Which way cars take through the town: from destination to destination, as quickly as they can."""

import functools
import math
from bisect import bisect_right
from collections.abc import Iterator
from itertools import accumulate

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from genie_sim.worlds.town.rules import TownRules

MAX_DRAWS = 10_000  # of a first destination: who gets the same each time gets no other

Node = tuple[int, int]  # the crossing of the i-th street from the west and the j-th from the south


class Commuting:
    """Who goes where: popular destinations, and the quickest way to each from every junction."""

    def __init__(self, rules: TownRules, random: np.random.Generator) -> None:
        self.rules = rules
        self._east, self._north = rules.blocks
        self._nodes = [(i, j) for i in range(self._east + 1) for j in range(self._north + 1)]
        self._number = {node: number for number, node in enumerate(self._nodes)}
        count = min(rules.destinations, len(self._nodes))
        order = random.permutation(len(self._nodes)).tolist()
        self._destinations: list[Node] = [self._nodes[k] for k in order[:count]]
        weights = [(k + 1) ** -rules.popularity for k in range(count)]
        self._shares = [share / math.fsum(weights) for share in accumulate(weights)]
        self._away = functools.cache(self._seconds_to)

    def destination(self, draw: float) -> Node:
        """The destination that a number in [0, 1) stands for."""
        return self._destinations[
            min(bisect_right(self._shares, draw), len(self._destinations) - 1)
        ]

    def neighbours(self, node: Node) -> Iterator[Node]:
        for way_i, way_j in ((1, 0), (0, 1), (-1, 0), (0, -1)):
            i, j = node[0] + way_i, node[1] + way_j
            if 0 <= i <= self._east and 0 <= j <= self._north:
                yield i, j

    def limit_mps(self, a: Node, b: Node) -> float:
        return self.rules.limit_mps(a[1] if a[1] == b[1] else a[0])

    def after(self, before: Node | None, node: Node, destination: Node) -> Node:
        """The next junction on the quickest way; straight on rather than a turn that gains nothing,
        never back.
        """
        away_s = self._away(destination)
        straight_on = before and (2 * node[0] - before[0], 2 * node[1] - before[1])

        def cost(neighbour: Node) -> float:
            cost_s = self.rules.block_m / self.limit_mps(node, neighbour) + away_s[neighbour]
            return cost_s if neighbour == straight_on or before is None else cost_s + 1e-3

        return min(
            (neighbour for neighbour in self.neighbours(node) if neighbour != before),
            key=cost,
        )

    def _seconds_to(self, destination: Node) -> dict[Node, float]:
        """Seconds from every junction to a destination."""
        seconds = dijkstra(self._seconds, indices=self._number[destination]).tolist()
        return dict(zip(self._nodes, seconds, strict=True))

    @functools.cached_property
    def _seconds(self) -> csr_array:
        """From each junction to its neighbours."""
        legs = [(a, b) for a in self._nodes for b in self.neighbours(a)]
        seconds = [self.rules.block_m / self.limit_mps(a, b) for a, b in legs]
        rows, columns = np.array([[self._number[a], self._number[b]] for a, b in legs]).T
        return csr_array((seconds, (rows, columns)), shape=(len(self._nodes),) * 2)

    def trip(self, random: np.random.Generator) -> Iterator[Node]:
        """The junctions that a car passes, without end: it starts anywhere on the way to its first
        destination.
        """
        draws = random.random(3).tolist()
        node = (int(draws[0] * (self._east + 1)), int(draws[1] * (self._north + 1)))
        draw = draws[2]
        for _ in range(MAX_DRAWS if len(self._destinations) > 1 else 0):
            if self.destination(draw) != node:
                break
            draw = float(random.random())
        destination = self._elsewhere(node, draw)
        way, before = [node], None
        while node != destination:
            before, node = node, self.after(before, node, destination)
            way.append(node)
        first = int(float(random.random()) * (len(way) - 1))
        yield from way[first:]
        while True:
            destination = self._elsewhere(node, float(random.random()))
            # Who never turns back may circle round a destination: after so many legs, about four
            # times the way across the town, another one is drawn.
            for _ in range(4 * (self._east + self._north + 2)):
                if node == destination:
                    break
                before, node = node, self.after(before, node, destination)
                yield node

    def _elsewhere(self, node: Node, draw: float) -> Node:
        """The destination that a number in [0, 1) stands for; on the other side of the town where
        that is here.
        """
        destination = self.destination(draw)
        if destination != node:
            return destination
        mirrored = (self._east - node[0], self._north - node[1])
        return mirrored if mirrored != node else (0, 0)
