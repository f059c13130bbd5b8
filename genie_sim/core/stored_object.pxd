cdef class StoredObject:
    cdef public object number
    cdef public object label
    cdef public object score
    cdef public object confidence
    cdef public object location
    cdef public double east_m
    cdef public double north_m
    cdef public object first_ns
    cdef public object seen_ns
    cdef public object sightings
    cdef public object origins
    cdef public object counted_ns
    cdef public object seen_in
    cdef object _detection
    cpdef as_detection(self)
    cpdef look(self, header)
