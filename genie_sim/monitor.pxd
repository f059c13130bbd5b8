cimport cython

cdef class Span:
    cdef public object label
    cdef public long long end_ns
    cdef public Span before
    cdef public object header
    @cython.locals(last=Span, first=Span)
    cpdef list since(self, begin_ns)
