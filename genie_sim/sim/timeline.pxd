from genie_sim.monitor cimport Span

cdef struct Due:
    long long at_ns
    long long number  # of the call, in the order in which they were scheduled
    Py_ssize_t place  # where the call itself is

cdef class Timeline:
    cdef public long long now
    cdef public Span path
    cdef bint _is_traced
    cdef public object _urgent
    cdef Due *_heap
    cdef Py_ssize_t _scheduled
    cdef Py_ssize_t _room
    cdef long long _numbers
    cdef list _calls
    cdef list _arguments
    cdef list _free
    cpdef after(self, delay_ns, call, tuple arguments=*, label=*)
    cpdef begin(self, header)
    cpdef waited(self, Span path, label)
    cdef _carry_out_next(self)
    cdef _push(self, long long at_ns, call, tuple arguments)
    cdef Due _pop(self) noexcept
