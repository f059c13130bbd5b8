from genie_sim.core.maps cimport Map
from genie_sim.grid cimport Grid
from genie_sim.core.stored_object cimport StoredObject
from genie_sim.core.view cimport ViewSector
cimport cython

cdef class ObjectMap(Map):
    cdef public object _freshness
    cdef public object _boosted_confidence
    cdef public object _rate
    cdef public object _threshold
    cdef public object _locations
    cdef public bint _any_class
    cdef public bint _counts_origins
    cdef public Grid _view_grid
    cdef public object _count
    cdef public object _numbers
    cdef public list _to_forget
    cdef public object _ties
    cdef public dict _boosted
    @cython.locals(stored=StoredObject)
    cpdef sight(self, seen, now_ns=*, header=*)
    cpdef _confident_part(self, answer, stored_objects, to, now_ns)
    cpdef forget(self, now_ns)
    cpdef match(self, label, location)
    cpdef at(self, location)
    @cython.locals(sector=ViewSector, stored=StoredObject)
    cpdef in_view(self, pose, horizontal_fov_rad, range_m)
    cpdef _add(self, seen, location, now_ns, header)
    cpdef _remove(self, StoredObject stored)
