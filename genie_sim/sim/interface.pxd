cimport cython

cdef class InterfaceUse:
    cdef public long long tail_ns
    cdef long long _tail_time_ns
    cdef long long _transfers
    cdef long long _transfer_ns
    cdef long long _since_ns
    cdef object _idle_since_ns
    @cython.locals(idle_ns="long long")
    cpdef begin(self, long long now_ns)
    cpdef end(self, long long now_ns)
