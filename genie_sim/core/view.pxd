cimport cython

cdef class ViewSector:
    cdef public tuple ahead
    cdef public double half_rad
    cdef public double min_cosine
    cdef public object pose
    cdef public double range_m
    cpdef distance_m(self, double east_m, double north_m)
    @cython.locals(
        east_m=double, north_m=double, range_m=double, cosine=double, sine=double,
        ahead_east_m=double, ahead_north_m=double, tip_east_m=double, tip_north_m=double,
    )
    cpdef tuple box(self)
