from genie_sim.core.maps cimport EnhancedAnswer, LookupCounts, object_lookups
from genie_sim.core.message_cache cimport MessageCache, PendingIndex, PendingRequest, Requester
cimport cython

cdef class Arrival:
    cdef public object topic
    cdef public bint is_request
    cdef public bint is_remote
    cdef public bint is_learned
    cdef public bint is_broadcast

cdef class GenieNode:
    cdef public object name
    cdef public object rules
    cdef public object object_map
    cdef public object _own_origins
    cdef public object _key
    cdef public object _new_cache
    cdef public PendingIndex _pending
    cdef public object _map_answer
    cdef public object _readings
    cdef public object _local
    cdef public object _remote
    cdef public object _names_changes
    cdef public tuple _subscribed
    cdef public tuple _published
    cdef public dict _caches
    cdef public dict _arrivals
    @cython.locals(
        effects=list, arrival=Arrival, pending=PendingRequest, answer=EnhancedAnswer, cache=MessageCache,
        requester=Requester, equal=PendingRequest, opened=PendingRequest, boosted=EnhancedAnswer,
    )
    cpdef on_message(self, topic, message, now_ns, sender=*)
    @cython.locals(cache=MessageCache, entries="Py_ssize_t")
    cpdef cache_entries(self)
    cpdef list _time_passes(self, now_ns)
    cpdef _deadline_ns(self, now_ns)
    cpdef EnhancedAnswer _learn(self, Arrival arrival, answer, PendingRequest pending, now_ns)
    @cython.locals(cache=MessageCache)
    cpdef _store(self, topic, answer, PendingRequest pending, now_ns)
    @cython.locals(released=list, requester=Requester)
    cpdef list _release(self, Arrival arrival, EnhancedAnswer answer, PendingRequest pending)
    cpdef list _map_answers(self, viewer, now_ns)
    cpdef _publication(self, topic, answer, Requester requester)
    cpdef _image_lookup(self, Requester requester, outcome)
    cpdef _object_lookups(self, header, kind, LookupCounts counts)
