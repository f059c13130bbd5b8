"""``place_index.py`` for the compiled engine: the places of a cell stand side by side in memory.

Of the large cells that a search touches, it looks only at what is near enough from west to east.
"""

import math
from operator import itemgetter

from cpython.ref cimport Py_DECREF, Py_INCREF, PyObject
from libc.math cimport fabs, floor, fmod, sqrt
from libc.stdlib cimport free, realloc
from libc.string cimport memmove

cdef double ROW = 2.0**26  # see ``grid.py``
cdef double MARGIN = 1.01  # of the reach: room for rounding
cdef Py_ssize_t FIRST_ROOM = 4, MAX_CELLS_WALKED = 16
cdef double NARROW = 1e-9  # so near to a border it matters how a number is rounded


cdef inline double cell_of(double place_m, double side_m) noexcept:
    """``place_m // side_m`` as Python rounds it, for positive sides."""
    cdef double quotient = place_m / side_m, whole = floor(quotient), rest
    if NARROW < quotient - whole < 1.0 - NARROW:
        return whole
    rest = fmod(place_m, side_m)
    quotient = (place_m - rest) / side_m
    if rest < 0.0:
        quotient -= 1.0
    whole = floor(quotient)
    return whole + 1.0 if quotient - whole > 0.5 else whole


cdef class Block:
    """The places of one cell in the order in which they were added, and that from west to east."""

    def __dealloc__(self):
        cdef Py_ssize_t index
        for index in range(self.count):
            Py_DECREF(<object>self.places[index].kind)
            Py_DECREF(<object>self.places[index].item)
        free(self.places)
        free(self.eastward)

    cdef Py_ssize_t first(self, double west_m) noexcept:
        """Where in ``eastward`` the places begin that are not farther west."""
        cdef Py_ssize_t low = 0, high = self.count, middle
        while low < high:
            middle = (low + high) // 2
            if self.places[self.eastward[middle]].east_m < west_m:
                low = middle + 1
            else:
                high = middle
        return low

    cdef add(self, Place place):
        cdef Py_ssize_t where = self.first(place.east_m)
        if self.count == self.room:
            self.widen(2 * self.room if self.room else FIRST_ROOM)
        Py_INCREF(<object>place.kind)
        Py_INCREF(<object>place.item)
        memmove(
            &self.eastward[where + 1],
            &self.eastward[where],
            (self.count - where) * sizeof(Py_ssize_t),
        )
        self.eastward[where] = self.count
        self.places[self.count] = place
        self.count += 1

    cdef widen(self, Py_ssize_t room):
        cdef Place *places = <Place *>realloc(self.places, room * sizeof(Place))
        if places == NULL:
            raise MemoryError
        self.places = places
        cdef Py_ssize_t *eastward = <Py_ssize_t *>realloc(self.eastward, room * sizeof(Py_ssize_t))
        if eastward == NULL:
            raise MemoryError
        self.eastward, self.room = eastward, room

    cdef remove(self, Py_ssize_t index):
        cdef Py_ssize_t where, kept = 0
        kind, item = <object>self.places[index].kind, <object>self.places[index].item
        for where in range(self.count):
            if self.eastward[where] != index:
                self.eastward[kept] = self.eastward[where] - (self.eastward[where] > index)
                kept += 1
        self.count -= 1
        memmove(
            &self.places[index], &self.places[index + 1], (self.count - index) * sizeof(Place)
        )
        Py_DECREF(kind)
        Py_DECREF(item)


cdef class PlaceIndex:
    """See ``place_index.py``."""

    def __init__(self, cell_m, reach_m):
        self._cell_m, self._reach_m, self._reach2_m2 = cell_m, MARGIN * reach_m, reach_m**2
        self._blocks = {}  # by cell

    @classmethod
    def __class_getitem__(cls, item):
        return cls

    def __iter__(self):
        cdef Block block
        cdef Py_ssize_t index
        for block in self._blocks.values():
            for index in range(block.count):
                yield <object>block.places[index].item

    cpdef add(self, item, kind, double east_m, double north_m):
        cdef Place place
        cdef Block block = self._block(east_m, north_m)
        if block is None:
            block = Block()
            self._last_touched = None
            block.column, block.row = cell_of(east_m, self._cell_m), cell_of(north_m, self._cell_m)
            self._blocks[block.column + block.row * ROW] = block
        place.east_m, place.north_m, place.number = east_m, north_m, self._numbers
        place.kind, place.item = <PyObject *>kind, <PyObject *>item
        self._numbers += 1
        block.add(place)

    cpdef remove(self, item, kind, double east_m, double north_m):
        cdef Block block = self._block(east_m, north_m)
        cdef Py_ssize_t index
        if block is None:
            raise KeyError(item)
        for index in range(block.count):
            if block.places[index].item == <PyObject *>item:
                break
        else:
            raise ValueError(item)
        block.remove(index)
        if not block.count:
            self._last_touched = None
            del self._blocks[block.column + block.row * ROW]

    cpdef nearest(self, kind, double east_m, double north_m):
        cdef double reach_m = self._reach_m, nearest2_m2 = self._reach2_m2
        cdef double away_east_m, away_north_m, distance2_m2
        cdef Place *nearest = NULL
        cdef Place *place
        cdef Block block
        cdef Py_ssize_t where
        for block in self._touched(
            east_m - reach_m, east_m + reach_m, north_m - reach_m, north_m + reach_m
        ):
            for where in range(block.first(east_m - reach_m), block.count):
                place = &block.places[block.eastward[where]]
                if place.east_m > east_m + reach_m:
                    break
                away_east_m, away_north_m = place.east_m - east_m, place.north_m - north_m
                distance2_m2 = away_east_m * away_east_m + away_north_m * away_north_m
                if not distance2_m2 <= nearest2_m2:
                    continue
                if distance2_m2 == nearest2_m2 and nearest and nearest.number < place.number:
                    continue
                if kind is None or place.kind == <PyObject *>kind or <object>place.kind == kind:
                    nearest, nearest2_m2 = place, distance2_m2
        return <object>nearest.item if nearest else None

    cpdef list at(self, double east_m, double north_m):
        cdef double reach_m = self._reach_m, away_east_m, away_north_m
        cdef list items = [], numbers = []
        cdef Place *place
        cdef Block block
        cdef Py_ssize_t where, before
        for block in self._touched(
            east_m - reach_m, east_m + reach_m, north_m - reach_m, north_m + reach_m
        ):
            for where in range(block.first(east_m - reach_m), block.count):
                place = &block.places[block.eastward[where]]
                if place.east_m > east_m + reach_m:
                    break
                away_east_m, away_north_m = place.east_m - east_m, place.north_m - north_m
                if away_east_m * away_east_m + away_north_m * away_north_m <= self._reach2_m2:
                    before = len(numbers)
                    while before and <long long>numbers[before - 1] > place.number:
                        before -= 1
                    numbers.insert(before, place.number)
                    items.insert(before, <object>place.item)
        return items

    cpdef list in_sector(
        self, tuple box, tuple tip, tuple ahead, double min_cosine, double range_m
    ):
        cdef double east_m = tip[0], north_m = tip[1], ahead_east = ahead[0], ahead_north = ahead[1]
        cdef double away_east_m, away_north_m, ahead_m, distance_m
        cdef list items = []
        cdef Place *place
        cdef Block block
        cdef Py_ssize_t index
        for block in self._touched(box[0], box[1], box[2], box[3]):
            for index in range(block.count):
                place = &block.places[index]
                away_east_m, away_north_m = place.east_m - east_m, place.north_m - north_m
                ahead_m = away_east_m * ahead_east + away_north_m * ahead_north
                if ahead_m < 0.0 and 0.0 <= min_cosine:
                    continue
                distance_m = sqrt(away_east_m * away_east_m + away_north_m * away_north_m)
                if (
                    fabs(distance_m - range_m) <= NARROW * range_m
                    or fabs(ahead_m - min_cosine * distance_m) <= NARROW * distance_m
                ):
                    distance_m = math.hypot(away_east_m, away_north_m)
                if distance_m <= range_m and ahead_m >= min_cosine * distance_m:
                    items.append(<object>place.item)
        return items

    cdef Block _block(self, double east_m, double north_m):
        """What is in the cell at a place; None: nothing."""
        return self._blocks.get(
            cell_of(east_m, self._cell_m) + cell_of(north_m, self._cell_m) * ROW
        )

    cdef list _touched(self, double west_m, double east_m, double south_m, double north_m):
        """The blocks that an upright rectangle touches, column by column."""
        cdef double west = cell_of(west_m, self._cell_m), east = cell_of(east_m, self._cell_m)
        cdef double south = cell_of(south_m, self._cell_m), north = cell_of(north_m, self._cell_m)
        cdef double cells = (east - west + 1.0) * (north - south + 1.0)
        cdef Py_ssize_t column, row
        cdef Block block
        cdef list blocks = self._last_touched
        if blocks is not None and west == self._west and east == self._east:
            if south == self._south and north == self._north:
                return blocks
        self._west, self._east, self._south, self._north = west, east, south, north
        self._last_touched = blocks = []
        if 1.0 <= cells <= MAX_CELLS_WALKED:
            for column in range(<Py_ssize_t>(east - west) + 1):
                for row in range(<Py_ssize_t>(north - south) + 1):
                    block = self._blocks.get(west + column + (south + row) * ROW)
                    if block is not None:
                        blocks.append(block)
            return blocks
        places = [(block.column, block.row, block) for block in self._blocks.values()]
        for where in sorted(places, key=itemgetter(0, 1)):
            if west <= where[0] <= east and south <= where[1] <= north:
                blocks.append(where[2])
        return blocks
