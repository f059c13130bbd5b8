cdef class InterfaceUse:
    cdef public object tail_ns
    cdef object _tail_time_ns
    cdef object _transfers
    cdef object _transfer_ns
    cdef object _since_ns
    cdef object _idle_since_ns
    cpdef begin(self, now_ns)
    cpdef end(self, now_ns)
