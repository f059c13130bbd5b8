from genie_sim.core.maps cimport EnhancedAnswer, Map
from genie_sim.core.stored_object cimport StoredObject
from genie_sim.core.view cimport ViewSector
from genie_sim.messages cimport Detection
from genie_sim.place_index cimport PlaceIndex
cimport cython

cdef class ObjectMap(Map):
    cdef public object _freshness
    cdef public bint _keeps_back
    cdef public bint _notes_sightings
    cdef public bint _forgets
    cdef public object _boosted_confidence
    cdef public object _rate
    cdef public object _threshold
    cdef public bint _ranks_confidences
    cdef public PlaceIndex _places
    cdef public object _same_location
    cdef public bint _any_class
    cdef public bint _counts_origins
    cdef public long _count
    cdef public long long _next_number
    cdef public list _to_forget
    cdef public long long _next_tie
    cdef public dict _boosted
    @cython.locals(
        seen=Detection, stored=StoredObject, is_of_map=bint, objects=list, stored_objects=list,
        changes=list, requests=long, updates=long, threshold=double,
        boost_sum=double,
    )
    cpdef EnhancedAnswer _learn(self, answer, now_ns, bint names_changes, bint leaves)
    @cython.locals(stored=StoredObject)
    cpdef sight(self, Detection seen, now_ns=*, header=*)
    @cython.locals(
        detection=Detection, stored=StoredObject, other=StoredObject, objects=list,
        stored_objects=list, others=list, requests=long, hits=long, candidates=long, is_hit=bint,
        threshold=double, any_class=bint,
    )
    cpdef enhanced_cache_boost_data(self, answer, header, viewer, now_ns)
    @cython.locals(
        detection=Detection, confident=list, keeps_back=bint, threshold=double, place="Py_ssize_t",
    )
    cpdef _confident_part(self, answer, stored_objects, to, now_ns)
    @cython.locals(stored=StoredObject)
    cpdef forget(self, now_ns)
    @cython.locals(stored=StoredObject, detections=list, keeps_back=bint)
    cpdef visible(self, viewer, range_m, now_ns)
    cpdef match(self, label, tuple location)
    cpdef at(self, tuple location)
    @cython.locals(sector=ViewSector, stored=StoredObject, in_sector=list, objects=list, threshold=double)
    cpdef in_view(self, pose, horizontal_fov_rad, range_m)
    cpdef _add(self, Detection seen, tuple location, now_ns, header)
    cpdef _remove(self, StoredObject stored)
