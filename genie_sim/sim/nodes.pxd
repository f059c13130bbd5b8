from genie_sim.messages cimport Publish
from genie_sim.sim.ros_graph cimport Node
cimport cython

cdef class DetectorNode(Node):
    cpdef work(self, message, done, tuple arguments)
    cpdef handle(self, topic, message, sender)

cdef class InterceptorNode(Node):
    cdef public object pure
    cdef public object _make
    cdef public object _key
    cdef public object _costs_nothing
    cdef public object _per_entry_ns
    cdef public object _observe
    cdef public bint _timer_set
    cdef public object _pass_time_ns
    cdef public bint _charges_answers
    cdef public object _pending
    cdef public object _paths
    cpdef work(self, message, done, tuple arguments)
    cpdef handle(self, topic, message, sender)
    cpdef _carry_out(self, effects)
    cpdef _publish_effect(self, Publish effect, path)
    cpdef _is_own_answer(self, Publish effect)
    cpdef _publish_own_answer(self, Publish effect)
    cpdef _set_timer(self)
