cdef class Map:
    pass
