cdef class Span:
    cdef public object label
    cdef public object end_ns
    cdef public Span before
    cdef public object header
