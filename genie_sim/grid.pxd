# Sides and places stay Python's numbers: C rounds a // b in another way.
cdef class Grid:
    cdef public object side_m
    cdef public dict _cells
    cpdef cell(self, east_m, north_m)
    cpdef cells(self, west_m, east_m, south_m, north_m)
    cpdef add(self, cell, item)
    cpdef remove(self, cell, item)
    cpdef at(self, east_m, north_m)
