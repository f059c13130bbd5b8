cdef struct Due:
    long long at_ns
    long long number  # of the call, in the order in which they were scheduled
    Py_ssize_t place  # where the call itself is

cdef class Timeline:
    cdef public long long now
    cdef public object path
    cdef public object _urgent
    cdef Due *_heap
    cdef Py_ssize_t _scheduled
    cdef long long _numbers
    cdef list _calls
    cdef list _arguments
    cpdef after(self, delay_ns, call, tuple arguments=*, label=*)
    cpdef begin(self, header)
    cpdef waited(self, path, label)
    cdef _carry_out_next(self)
    cdef _push(self, long long at_ns, call, tuple arguments)
    cdef _grow(self)
    cdef Due _pop(self) noexcept
