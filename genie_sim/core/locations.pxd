from genie_sim.grid cimport Grid
from genie_sim.core.stored_object cimport StoredObject
cimport cython

cdef class WithinGate:
    cdef Grid _grid
    cdef double _reach_m
    cdef double _gate2_m2
    cpdef add(self, StoredObject stored)
    cpdef remove(self, StoredObject stored)
    @cython.locals(east_m=double, north_m=double, stored=StoredObject, nearest2_m2=double, away_east_m=double, away_north_m=double, distance2_m2=double)
    cpdef nearest(self, label, location)
    @cython.locals(east_m=double, north_m=double, stored=StoredObject, away_east_m=double, away_north_m=double)
    cpdef at(self, location)
    cpdef _cells(self, StoredObject stored)
