from genie_sim.sim.device cimport Host
from genie_sim.sim.timeline cimport Timeline
cimport cython

cdef class Subscriber:
    cdef public object address
    cpdef deliver(self, topic, message, sender)

cdef class Graph:
    cdef public Host host
    cdef public Timeline clock
    cdef public object name
    cdef public object entry
    cdef public long long queue_length
    cdef public object dropped
    cdef public object _hop
    cdef public dict _subscribers
    cdef public dict _bridges
    cdef public dict _nodes
    cdef public dict _remapped
    @cython.locals(route=tuple, receivers=list)
    cpdef publish(self, Node node, topic, message, to=*)
    cpdef inject(self, topic, message, sender)
    @cython.locals(receiver=Subscriber)
    cpdef _arrive(self, receivers, topic, message, sender)

cdef class Node(Subscriber):
    cdef public object name
    cdef public Host host
    cdef public Graph graph
    cdef public Timeline clock
    cdef public tuple subscribes
    cdef public tuple publishes
    cdef public long long drops
    cdef public long long completed
    cdef public long long queued
    cdef public dict routes
    cdef public object work_label
    cdef public object _queueing
    cdef public long long _idle_threads
    cdef public long long _threads
    cdef public dict _queues
    cdef public list _in_service
    cdef public long long _generation
    cdef public long long _arrivals
    cpdef deliver(self, topic, message, sender)
    cpdef publish(self, topic, message, to=*)
    cpdef work(self, message, done, tuple arguments)
    cpdef handle(self, topic, message, sender)
    cpdef _serve(self, topic, message, sender)
    @cython.locals(oldest="long long", arrival="long long")
    cpdef _next_topic(self)
