"""``timeline.py`` for the compiled engine: the same calls in the same order, out of a heap in C.

The heap holds the instants; the calls themselves are in lists, where Python's collector sees them.
Each entry of the heap has its place in these lists; those behind the heap's end are free.
"""
# cython: boundscheck=False, wraparound=False

from collections import deque
from math import ceil

from cpython.long cimport PyLong_AsLongLong
from libc.stdlib cimport free, realloc

from genie_sim.monitor cimport Span

cdef Py_ssize_t FIRST_ROOM = 64  # calls
cdef long long NEVER_NS = 0x7FFFFFFFFFFFFFFF


cdef inline bint comes_before(const Due *one, const Due *other) noexcept:
    if one.at_ns != other.at_ns:
        return one.at_ns < other.at_ns
    if one.scheduled_ns != other.scheduled_ns:
        return one.scheduled_ns < other.scheduled_ns
    return one.number < other.number


cdef class Timeline:
    """See ``timeline.py``. An instant that 64 bits do not hold never comes."""

    def __init__(self, *, is_traced=False):
        self.now = 0
        self.path = None
        self._is_traced = is_traced
        self._urgent = deque()
        self._calls, self._arguments = [], []

    def __dealloc__(self):
        free(self._heap)

    cpdef after(self, delay_ns, call, tuple arguments=(), label=None):
        cdef long long delay
        cdef Due due
        try:
            delay = PyLong_AsLongLong(delay_ns)
        except OverflowError:
            delay = NEVER_NS
        if delay > NEVER_NS - self.now:
            delay = NEVER_NS - self.now
        if self.path is not None and label is not None:
            call, arguments = None, (self.path, label, call, arguments)
        due.at_ns, due.scheduled_ns, due.is_foreign = self.now + delay, self.now, False
        self._push(due, call, arguments)

    cpdef from_elsewhere(self, long long at_ns, long long scheduled_ns, call, tuple arguments):
        cdef Due due
        due.at_ns, due.scheduled_ns, due.is_foreign = at_ns, scheduled_ns, True
        self._push(due, call, arguments)

    cpdef begin(self, header):
        if self._is_traced:
            self.path = Span(None, self.now, None, header)

    cpdef waited(self, Span path, label):
        if path is not None and path.end_ns != self.now:
            path = Span(label, self.now, path, path.header)
        self.path = path

    def next_ns(self):
        return self._heap[0].at_ns if self._scheduled else None

    def step(self):
        if not self._scheduled:
            raise IndexError("no call is scheduled")
        self._carry_out_next()

    def pass_time(self, until_ns):
        cdef long long end_ns = ceil(until_ns)
        urgent = self._urgent
        while urgent:
            self.step()
        while self._scheduled and self._heap[0].at_ns < end_ns:
            self._carry_out_next()
            while urgent:
                self.step()
        self.now = int(until_ns)

    def waits_only_for(self, call):
        cdef Py_ssize_t index
        for index in range(self._scheduled):
            if self._calls[self._heap[index].place] != call:
                return False
        return True

    def clear(self):
        cdef Py_ssize_t place
        for place in range(len(self._calls)):
            self._calls[place] = self._arguments[place] = None
        self._scheduled = 0

    cdef _carry_out_next(self):
        cdef Due due = self._pop()
        cdef tuple arguments = self._arguments[due.place]
        call = self._calls[due.place]
        self._calls[due.place] = self._arguments[due.place] = None
        if due.at_ns == self.now and due.scheduled_ns == self.scheduled_ns:
            self.has_ties |= due.is_foreign or self._is_foreign
        self.now, self.scheduled_ns = due.at_ns, due.scheduled_ns
        self._is_foreign = due.is_foreign
        if call is None:  # on the path of a frame
            path, label, call, arguments = arguments
            self.waited(path, label)
            call(*arguments)
            self.path = None
        else:
            call(*arguments)

    cdef _push(self, Due due, call, tuple arguments):
        cdef Py_ssize_t here, parent
        if self._scheduled == len(self._calls):
            self._grow()
        due.number = self._numbers
        due.place = self._heap[self._scheduled].place
        self._numbers += 1
        self._calls[due.place] = call
        self._arguments[due.place] = arguments
        here = self._scheduled
        self._scheduled += 1
        while here:
            parent = (here - 1) // 2
            if not comes_before(&due, &self._heap[parent]):
                break
            self._heap[here] = self._heap[parent]
            here = parent
        self._heap[here] = due

    cdef _grow(self):
        """Makes room for twice as many calls."""
        cdef Py_ssize_t place, room = len(self._calls), added = room if room else FIRST_ROOM
        cdef Due *larger = <Due *>realloc(self._heap, (room + added) * sizeof(Due))
        if larger == NULL:
            raise MemoryError
        self._heap = larger
        for place in range(room, room + added):
            larger[place].place = place
        self._calls += [None] * added
        self._arguments += [None] * added

    cdef Due _pop(self) noexcept:
        """Takes out the next call; there is one."""
        cdef Due first = self._heap[0]
        cdef Due last
        cdef Py_ssize_t here = 0, child = 1
        self._scheduled -= 1
        last = self._heap[self._scheduled]
        while child < self._scheduled:
            if child + 1 < self._scheduled and comes_before(
                &self._heap[child + 1], &self._heap[child]
            ):
                child += 1
            if not comes_before(&self._heap[child], &last):
                break
            self._heap[here] = self._heap[child]
            here = child
            child = 2 * here + 1
        self._heap[here] = last
        self._heap[self._scheduled].place = first.place
        return first
