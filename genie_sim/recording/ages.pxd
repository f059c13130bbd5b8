cimport cython

cdef class FirstSeen:
    cdef dict _sights
    cdef dict _seen_ns
    @cython.locals(result=list, stamps_ns=list, sights=list, seen_ns=dict)
    cpdef seen_ns(self, objects, given, held)
    @cython.locals(seen_ns=dict)
    cpdef _note(self, given, list sights)
    cpdef _recode(self, objects)
