from genie_sim.messages cimport Detection
cimport cython

cdef class Objects:
    cdef public object labels
    cdef public object cars
    cdef public object classes
    cdef public object sights
    cdef dict _numbers
    cdef dict _of_lists
    cdef list _kept
    cdef list _new
    cdef Py_ssize_t _count
    cdef object _columns
    @cython.locals(detection=Detection, numbers=list)
    cpdef bytes _of_list(self, objects)
    cpdef _add(self, Detection detection)
