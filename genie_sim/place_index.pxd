from cpython.ref cimport PyObject

cdef struct Place:
    double east_m
    double north_m
    long long number  # of the item, in the order in which they were added
    PyObject *kind
    PyObject *item

cdef class Block:
    cdef double column
    cdef double row
    cdef Place *places
    cdef Py_ssize_t *eastward  # their indices, from west to east
    cdef Py_ssize_t count
    cdef Py_ssize_t room
    cdef Py_ssize_t first(self, double west_m) noexcept
    cdef add(self, Place place)
    cdef widen(self, Py_ssize_t room)
    cdef remove(self, Py_ssize_t index)

cdef class PlaceIndex:
    cdef double _cell_m
    cdef double _reach_m
    cdef double _reach2_m2
    cdef long long _numbers
    cdef dict _blocks
    cdef list _last_touched
    cdef double _west
    cdef double _east
    cdef double _south
    cdef double _north
    cdef Block _block(self, double east_m, double north_m)
    cdef list _touched(self, double west_m, double east_m, double south_m, double north_m)
    cpdef add(self, item, kind, double east_m, double north_m)
    cpdef remove(self, item, kind, double east_m, double north_m)
    cpdef nearest(self, kind, double east_m, double north_m)
    cpdef list at(self, double east_m, double north_m)
    cpdef list in_sector(
        self, tuple box, tuple tip, tuple ahead, double min_cosine, double range_m
    )
