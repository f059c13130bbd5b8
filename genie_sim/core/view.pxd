cdef class ViewSector:
    cdef double _ahead_east
    cdef double _ahead_north
    cdef double _min_cosine
    cdef public double half_rad
    cdef public object pose
    cdef public double range_m
    cpdef distance_m(self, double east_m, double north_m)
    cpdef box(self)
