"""``near_pairs.py`` for the compiled engine: theirs are in a hash table of cells.

A cell is twice as wide as the reach, so what is near a place is in its cell or in one of the three
that are nearest to the place.
"""

import numpy as np

from cpython.bytes cimport PyBytes_FromStringAndSize
from libc.math cimport floor
from libc.stdlib cimport free, malloc, realloc

PAIR = np.dtype([("ours", "i8"), ("theirs", "i8"), ("distance_m2", "f8")])

cdef struct Pair:
    long long ours
    long long theirs
    double distance_m2

cdef struct Place:
    long long group
    long long column  # of its cell
    long long row
    double east_m
    double north_m
    Py_ssize_t following  # in the same bucket; -1: none


cdef inline size_t bucket(long long group, long long column, long long row) noexcept:
    cdef size_t mixed = group * 0x9E3779B97F4A7C15ULL
    mixed ^= column * 0xBF58476D1CE4E5B9ULL ^ row * 0x94D049BB133111EBULL
    return mixed >> 32 ^ mixed >> 13


cdef class Pairs:
    """Pairs that are found, one after the other."""

    cdef Pair *pairs
    cdef Py_ssize_t count
    cdef Py_ssize_t room

    def __dealloc__(self):
        free(self.pairs)

    cdef int add(self, Pair pair) except -1:
        cdef Pair *larger
        if self.count == self.room:
            larger = <Pair *>realloc(self.pairs, (2 * self.room + 1024) * sizeof(Pair))
            if larger == NULL:
                raise MemoryError
            self.pairs, self.room = larger, 2 * self.room + 1024
        self.pairs[self.count] = pair
        self.count += 1
        return 0

    cdef columns(self):
        made = PyBytes_FromStringAndSize(<char *>self.pairs, self.count * sizeof(Pair))
        pairs = np.frombuffer(made, dtype=PAIR)
        return tuple(np.ascontiguousarray(pairs[name]) for name in PAIR.names)


def near_pairs(ours, theirs, double reach_m):
    """See ``near_pairs.py``."""
    cdef const long long[:] our_group = ours[0], their_group = theirs[0]
    cdef const double[:] our_east_m = ours[1], our_north_m = ours[2]
    cdef const double[:] their_east_m = theirs[1], their_north_m = theirs[2]
    cdef Py_ssize_t count = len(their_group), buckets = 1, number
    cdef double side_m = 2.0 * reach_m * (1.0 + 1e-9), max_distance_m2 = reach_m * reach_m
    cdef double east_m, north_m, away_east_m, away_north_m
    cdef long long group, column, row, first_column, first_row
    cdef size_t place
    cdef Pair pair
    cdef Place *there
    cdef Pairs pairs = Pairs()
    while buckets < 2 * count:
        buckets *= 2
    cdef Place *places = <Place *>malloc((count + 1) * sizeof(Place))
    cdef Py_ssize_t *first = <Py_ssize_t *>malloc(buckets * sizeof(Py_ssize_t))
    try:
        if places == NULL or first == NULL:
            raise MemoryError
        for number in range(buckets):
            first[number] = -1
        for number in range(count):
            group, east_m, north_m = their_group[number], their_east_m[number], their_north_m[number]
            column, row = <long long>floor(east_m / side_m), <long long>floor(north_m / side_m)
            place = bucket(group, column, row) & <size_t>(buckets - 1)
            places[number] = Place(group, column, row, east_m, north_m, first[place])
            first[place] = number
        for pair.ours in range(len(our_group)):
            group = our_group[pair.ours]
            east_m, north_m = our_east_m[pair.ours], our_north_m[pair.ours]
            first_column = <long long>floor(east_m / side_m - 0.5)
            first_row = <long long>floor(north_m / side_m - 0.5)
            for column in range(first_column, first_column + 2):
                for row in range(first_row, first_row + 2):
                    number = first[bucket(group, column, row) & <size_t>(buckets - 1)]
                    while number >= 0:
                        there = &places[number]
                        away_east_m, away_north_m = there.east_m - east_m, there.north_m - north_m
                        pair.theirs = number
                        pair.distance_m2 = away_east_m * away_east_m + away_north_m * away_north_m
                        if (
                            pair.distance_m2 <= max_distance_m2
                            and there.group == group
                            and there.column == column
                            and there.row == row
                        ):
                            pairs.add(pair)
                        number = there.following
    finally:
        free(places)
        free(first)
    return pairs.columns()
