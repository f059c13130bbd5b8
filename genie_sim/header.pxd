cdef class Header:
    cdef readonly object stamp_ns
    cdef readonly object frame_id
    cdef readonly object origin
    cdef Py_hash_t _hash
