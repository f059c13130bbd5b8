from genie_sim.core.stored_object cimport StoredObject
cimport cython

cdef class ViewSector:
    cdef double _ahead_east
    cdef double _ahead_north
    cdef double _min_cosine
    cdef public double half_rad
    cdef public object pose
    cdef public double range_m
    cpdef distance_m(self, double east_m, double north_m)
    @cython.locals(
        stored=StoredObject,
        east_m=double,
        north_m=double,
        ahead_east=double,
        ahead_north=double,
        min_cosine=double,
        range_m=double,
        away_east_m=double,
        away_north_m=double,
        ahead_m=double,
        distance_m=double,
    )
    cpdef list inside(self, objects)
    cpdef box(self)
