from genie_sim.header cimport Header
from genie_sim.messages cimport Detections, Image, ImageLookup, ObjectLookups
from genie_sim.monitor cimport Span
from genie_sim.recording.agreement cimport Agreement
from genie_sim.recording.map_accuracy cimport MapAccuracy
from genie_sim.recording.open_frame cimport OpenFrame
from genie_sim.recording.tables cimport Table
cimport cython

cdef class Log:
    cdef public object method
    cdef public object samples
    cdef public object wants_changes
    cdef public object wants_paths
    cdef public object published_frames
    cdef MapAccuracy _accuracy
    cdef object _posed
    cdef Table _frames
    cdef Table _resources
    cdef Table _hosts
    cdef Table _faults
    cdef Table _attacks
    cdef Table _lookups
    cdef Table _looks
    cdef Table _poses
    cdef Table _objects
    cdef Agreement _agreement
    cdef Table _steps
    cdef dict _open
    cdef dict _open_objects
    cdef object _object_counts
    @cython.locals(frame=OpenFrame, header=Header)
    cpdef published(self, Image image, number, lap)
    cpdef OpenFrame _frame(self, header)
    @cython.locals(frame=OpenFrame)
    cpdef received(self, header, now_ns)
    @cython.locals(settled=list, values=list, header=Header, frame=OpenFrame)
    cpdef close(self, before_ns=*)
    @cython.locals(frame=OpenFrame)
    cpdef carried(self, column, message)
    @cython.locals(frame=OpenFrame)
    cpdef answered(self, Detections answer, source, now_ns, path=*)
    @cython.locals(values=list)
    cpdef _note_steps(self, Span path, OpenFrame frame, is_first, is_fresh)
    @cython.locals(frame=OpenFrame)
    cpdef dropped(self, message, where)
    cpdef observe(self, placement, node, record, now_ns)
    cpdef _note_look(self, genie, event, now_ns, looked_ns=*)
    @cython.locals(frame=OpenFrame)
    cpdef _note_image_lookup(self, placement, genie, ImageLookup lookup, now_ns)
    cpdef _note_object_lookups(self, placement, genie, ObjectLookups lookups, now_ns)
    @cython.locals(values=list, numbers=dict)
    cpdef _note_changes(self, genie, changes, now_ns, forgotten=*)
    @cython.locals(values=list)
    cpdef sample(self, resources, now_ns)
