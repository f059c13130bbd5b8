cdef class Viewer:
    cdef public object header
    cdef public object pose
    cdef public object horizontal_fov_rad

cdef class LookupCounts:
    cdef public object requests
    cdef public object hits
    cdef public object updates
    cdef public object boost_sum
    cdef public object changes
    cdef public object forgotten

cdef class EnhancedAnswer:
    cdef public object answer
    cdef public object to_clients
    cdef public object to_neighbours
    cdef public object lookups

cdef class Map:
    pass

cpdef object_lookups(header, kind, LookupCounts counts, objects)
