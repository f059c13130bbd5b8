from genie_sim.sim.interface cimport InterfaceUse
from genie_sim.sim.ros_graph cimport Subscriber
from genie_sim.sim.timeline cimport Timeline
cimport cython

cdef class Transfer:
    cdef public object flow
    cdef public object message
    cdef public object deliver
    cdef public tuple arguments
    cdef public object carried
    cdef public object path

cdef class Link:
    cdef public Timeline clock
    cdef public object name
    cdef public long long completed
    cdef public long long drops
    cdef public long long sent_bytes
    cdef public list down_by
    cdef public InterfaceUse interface
    cdef object _is_connected
    cdef object _sender
    cdef object _transport
    cdef object _queueing
    cdef long long _queue_length
    cdef object _dropped
    cdef object _across
    cdef object _waiting
    cdef object _flows
    cdef Transfer _on_wire
    cdef bint _busy
    cdef long long _busy_since_ns
    cdef long long _busy_ns
    cdef object _last_arrival_ns
    @cython.locals(transfer=Transfer)
    cpdef send(self, flow, message, deliver, tuple arguments=*, carried=*)
    @cython.locals(clock=Timeline, transfer=Transfer, following=Transfer, now_ns="long long", size_bytes="long long")
    cpdef _transmitted(self)
    cdef _transmit(self, Transfer transfer)
    cpdef lose(self, message, where)

cdef class Bridge(Subscriber):
    cdef public Link link
    cdef object _codec
    cdef object _target
    cdef object _topic
    cdef object _carried
    cdef object _lost
    cdef object _border
    cdef bint _is_up
    cdef long long _times_up
    cpdef deliver(self, topic, message, sender)
