cimport cython

cdef class Timeline:
    cdef public object now
    cdef public object path
    cdef public list _instants
    cdef public dict _calls
    cdef public object _urgent
    @cython.locals(calls=list)
    cpdef after(self, delay_ns, call, tuple arguments=*, label=*)
    cpdef begin(self, header)
    cpdef waited(self, path, label)
