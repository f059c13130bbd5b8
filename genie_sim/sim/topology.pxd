from genie_sim.sim.link cimport Bridge
from genie_sim.sim.ros_graph cimport Subscriber
cimport cython

cdef class EdgeServer(Subscriber):
    cdef public object name
    cdef public object graph
    cdef public object config
    cdef public object target
    cdef public dict bridge_to
    @cython.locals(bridge=Bridge)
    cpdef deliver(self, topic, message, sender)
