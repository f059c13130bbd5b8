from genie_sim.messages cimport Detection
cimport cython

cdef class Objects:
    cdef public object labels
    cdef public object cars
    cdef public object classes
    cdef public dict sights
    cdef Py_ssize_t _count
    cdef dict _of_lists
    cdef list _kept
    cdef list _new
    cdef object _columns
    @cython.locals(detection=Detection, numbers=list, sights=dict)
    cpdef bytes _of_list(self, objects)
    cpdef sight(self, label, location)
    cpdef _add(self, label, location, sight, track)
