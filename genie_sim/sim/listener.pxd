from genie_sim.messages cimport Detections
from genie_sim.sim.ros_graph cimport Subscriber
from genie_sim.sim.timeline cimport Timeline
cimport cython

cdef class CarListener(Subscriber):
    cdef object _car
    cdef Timeline _clock
    cdef object _monitor
    cdef object _uplink
    cdef bint _has_server
    @cython.locals(clock=Timeline)
    cpdef deliver(self, topic, message, sender)
    cpdef _source(self, Detections answer)
