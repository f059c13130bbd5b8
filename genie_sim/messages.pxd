from genie_sim.header cimport Header as TypedHeader  # the .py hands on Header by its own name
cimport cython

cdef class Image:
    cdef public object header
    cdef public object size_bytes
    cdef public object digest
    cdef public object dhash
    cdef public object pose
    cdef public object horizontal_fov_rad
    cdef public object content
    cdef public object looks

cdef class Detection:
    cdef public object label
    cdef public object score
    cdef public object box
    cdef public object location
    cdef public object confidence
    cdef public object method
    cdef public object motion
    cdef public object seen_in
    cpdef with_confidence(self, confidence)

cdef class Detections:
    cdef public object header
    cdef public object objects
    cdef public object source
    cdef public object served_by
    cdef public object look
    cdef public object valid_ns
    cdef public object seen_in
    cpdef restamped(self, header)
    cpdef with_objects(self, objects)
    cpdef with_look(self, look, valid_ns)
    cpdef served(self, source, by, header=*)

cdef class Publish:
    cdef public object topic
    cdef public object message
    cdef public object to

cdef class ImageLookup:
    cdef public object header
    cdef public object outcome
    cdef public object requester
    cdef public object entries

cdef class ObjectLookups:
    cdef public object header
    cdef public object kind
    cdef public object requests
    cdef public object hits
    cdef public object updates
    cdef public object boost_sum
    cdef public object objects
    cdef public object changes
    cdef public object forgotten

@cython.locals(item=Detection, header=TypedHeader)
cpdef newest_look_ns(objects, newest_ns)
