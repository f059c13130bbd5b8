cdef class CarListener:
    cdef public object address
    cdef object _car
    cdef object _clock
    cdef object _monitor
    cdef object _uplink
    cdef bint _has_server
    cpdef deliver(self, topic, message, sender)
    cpdef _source(self, answer)
