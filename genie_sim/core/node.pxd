from genie_sim.core.message_cache cimport PendingIndex
cimport cython

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
    cpdef cache_entries(self)
    cpdef _time_passes(self, now_ns)
    cpdef _deadline_ns(self, now_ns)
    cpdef _learn(self, arrival, answer, pending, now_ns)
    cpdef _store(self, topic, answer, pending, now_ns)
    cpdef _map_answers(self, viewer, now_ns)
    cpdef _publication(self, topic, answer, requester)
    cpdef _image_lookup(self, requester, outcome)
    cpdef _object_lookups(self, header, kind, counts)
