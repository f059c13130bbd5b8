cdef class Table:
    cdef public object schema
    cdef public object name
    cdef object _buffers
    cdef list _new
    cdef Py_ssize_t _width
    cdef Py_ssize_t _room
    cdef Py_ssize_t _rows
    cdef object _spill
    cdef Py_ssize_t _spilled
    cdef object _writer
    cdef object _open
    cdef object _written
    cpdef append(self, values)
