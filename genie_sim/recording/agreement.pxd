cdef class Agreement:
    cdef object _method
    cdef object _table
    cdef object _objects
    cdef Py_ssize_t _window
    cdef list _answers
    cpdef add(self, answer)
