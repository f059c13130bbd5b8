cdef class WireChannel:
    cdef object _wire
    cdef object _rate_bps
    cdef object _rng
    cdef object _delays_ns
    cdef dict _occupied_ns
    cdef object _loss
    cdef object _losses
    cpdef occupied_ns(self, size_bytes, now_ns)
    cpdef delay_ns(self, size_bytes, now_ns)
