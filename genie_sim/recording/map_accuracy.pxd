cdef class MapAccuracy:
    cdef object _method
    cdef object _truths
    cdef object _table
    cdef object _judged_without_delay
    cdef object _all_streams
    cdef Py_ssize_t _window
    cdef dict _consumers
    cdef dict _first_streams
    cdef public object objects
    cdef object _cars
    cdef object _labels
    cdef object _first_seen
    cdef object _recent_places
    cdef object _later
    cdef object _judged
    cdef object _spans
    cdef list _scenes
    cdef list _given
    cpdef answered(self, answer, now_ns)
    cpdef published(self, image)
