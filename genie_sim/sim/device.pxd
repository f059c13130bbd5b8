from genie_sim.sim.timeline cimport Timeline
cimport cython

cdef class Job:
    cdef public object label
    cdef public long long pictures
    cdef public object done
    cdef public tuple arguments
    cdef public long long generation
    cdef public long long stalled_ns

cdef class Processor:
    cdef public Timeline clock
    cdef public object name
    cdef public object kind
    cdef public long long capacity
    cdef public long long completed
    cdef public long long jobs
    cdef object _queueing
    cdef long long _serving
    cdef object _waiting
    cdef long long _busy_ns
    cdef long long _generation
    cdef long long _stalls
    cdef long long _stall_began_ns
    cdef long long _stalled_ns
    cdef list _held
    cdef list _factors
    @cython.locals(clock=Timeline, job=Job)
    cpdef run(self, service_ns, done, tuple arguments=*, label=*, pictures=*)
    @cython.locals(job=Job)
    cpdef _begin_next(self)
    cpdef _begin(self, Job job, service_ns)
    @cython.locals(clock=Timeline, left_ns="long long")
    cpdef _finished(self, Job job)

cdef class Host:
    cdef public Timeline clock
    cdef public object name
    cdef public object device
    cdef public Processor accelerator
    cdef public Processor cpu
    cdef dict _hops_ns
    cdef object _detector_times
    cdef object _message_times
    cpdef hop_ns(self, size_bytes)
    cpdef infer(self, done, tuple arguments=*, label=*)
    @cython.locals(server=Processor)
    cpdef compute_key(self, name, done, tuple arguments=*, label=*)
    cpdef serve_message(self, done, tuple arguments=*, label=*)
