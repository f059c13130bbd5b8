from genie_sim.messages cimport Detection

cdef class StoredObject:
    cdef public long long number
    cdef public object label
    cdef public object score
    cdef public double confidence
    cdef public object location
    cdef public long long first_ns
    cdef public long long seen_ns
    cdef public long sightings
    cdef public object origins
    cdef public object counted_ns
    cdef public object seen_in
    cdef Detection _detection
    cpdef boost(self, double confidence)
    cpdef as_detection(self)
    cpdef look(self, header)
