from genie_sim.sim.timeline cimport Timeline
cimport cython

cdef class Processor:
    cdef public Timeline clock
    cdef public object name
    cdef public object kind
    cdef public object capacity
    cdef public object completed
    cdef public object jobs
    cdef object _queueing
    cdef object _serving
    cdef object _waiting
    cdef object _busy_ns
    cdef object _generation
    cdef object _stalls
    cdef object _stall_began_ns
    cdef object _stalled_ns
    cdef list _held
    cdef list _factors
    @cython.locals(clock=Timeline)
    cpdef run(self, service_ns, done, tuple arguments=*, label=*, pictures=*)
    @cython.locals(clock=Timeline)
    cpdef _begin_next(self)

cdef class Host:
    cdef public Timeline clock
    cdef public object name
    cdef public object device
    cdef public Processor accelerator
    cdef public Processor cpu
    cdef public object hop_ns
    cdef object _detector_times
    cdef object _message_times
    cpdef infer(self, done, tuple arguments=*, label=*)
    @cython.locals(server=Processor)
    cpdef compute_key(self, name, done, tuple arguments=*, label=*)
    cpdef serve_message(self, done, tuple arguments=*, label=*)
