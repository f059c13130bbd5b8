from genie_sim.sim.interface cimport InterfaceUse
from genie_sim.sim.link cimport Bridge
from genie_sim.sim.ros_graph cimport Subscriber
cimport cython

cdef class CarUplink(Subscriber):
    cdef public InterfaceUse interface
    cdef public object car
    cdef public object edge
    cdef object _network
    cdef object _graph
    cdef object _topics
    cdef object _model
    cdef object _edges
    cdef object _lost_by
    cdef dict _bridges
    cdef object _encoder
    cpdef deliver(self, topic, message, sender)
    @cython.locals(upwards=Bridge)
    cpdef _send(self, topic, message, sender)
