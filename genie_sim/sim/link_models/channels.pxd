from genie_sim.sim.timeline cimport Timeline
cimport cython

cdef class ChannelSender:
    cdef Timeline _clock
    cdef readonly object occupied_ns
    cdef public object delay_ns
    cpdef send(self, size_bytes, carried)
    cpdef set_up(self, is_up)
