from genie_sim.sim.link cimport Bridge
cimport cython

cdef class EdgeServer:
    cdef public object name
    cdef public object graph
    cdef public object config
    cdef public object target
    cdef public object address
    cdef public dict bridge_to
    @cython.locals(bridge=Bridge)
    cpdef deliver(self, topic, message, sender)
