cimport cython

cdef class MessageCache:
    cdef public object _index
    cdef public object _eviction
    cdef public object _capacity
    cdef public dict _answers
    cdef public object size_bytes
    cpdef get(self, key, now_ns)
    cpdef peek(self, key, now_ns)
    cpdef put(self, key, topic, answer, now_ns)
    cpdef _find(self, key, now_ns)
    cpdef _fits(self, entries, size_bytes)

cdef class Requester:
    cdef public object header
    cdef public object neighbour
    cdef public object name
    cdef public object served

cdef class PendingRequest:
    cdef public object topic
    cdef public object key
    cdef public object deadline_ns
    cdef public object forwarded
    cdef public object requesters
    cdef public object answered
    cdef public object viewer

cdef class PendingIndex:
    cdef public object _identity
    cdef public object _new_keys
    cdef public dict _by_header
    cdef public object _waiting
    cdef public dict _keys
    cdef public dict _open
    cdef public object next_deadline_ns
    cpdef by_header(self, header)
    cpdef by_key(self, topic, key)
    cpdef joinable(self, topic, key)
    cpdef open(self, header, PendingRequest pending)
    @cython.locals(pending=PendingRequest)
    cpdef expire(self, now_ns)
    cpdef close(self, PendingRequest pending)
