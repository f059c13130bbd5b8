from genie_sim.monitor cimport Span

cdef struct Due:
    long long at_ns
    long long scheduled_ns
    long long number  # of the call, in the order in which they were scheduled
    Py_ssize_t place  # where the call itself is
    bint is_foreign  # a timeline of another process scheduled it

cdef class Timeline:
    cdef public long long now
    cdef public long long scheduled_ns
    cdef public bint has_ties
    cdef public Span path
    cdef bint _is_traced
    cdef bint _is_foreign  # the current call
    cdef public object _urgent
    cdef Due *_heap
    cdef Py_ssize_t _scheduled
    cdef long long _numbers
    cdef list _calls
    cdef list _arguments
    cpdef after(self, delay_ns, call, tuple arguments=*, label=*)
    cpdef from_elsewhere(self, long long at_ns, long long scheduled_ns, call, tuple arguments)
    cpdef begin(self, header)
    cpdef waited(self, Span path, label)
    cdef _carry_out_next(self)
    cdef _push(self, Due due, call, tuple arguments)
    cdef _grow(self)
    cdef Due _pop(self) noexcept
