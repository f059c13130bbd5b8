cdef class OpenFrame:
    cdef public object method
    cdef public object car
    cdef public object stream
    cdef public object frame
    cdef public object lap
    cdef public object stamp_ns
    cdef public object received_ns
    cdef public object first_answer_ns
    cdef public object fresh_answer_ns
    cdef public object result_answer_ns
    cdef public object source
    cdef public object served_by
    cdef public object image_hit
    cdef public object coalesced
    cdef public object first_looked_ns
    cdef public object looked_ns
    cdef public object objects_fresh
    cdef public object objects_result
    cdef public object objects_served
    cdef public object bytes_up
    cdef public object bytes_down
    cdef public object drop
    cdef public object image
    cpdef tuple values(self)
