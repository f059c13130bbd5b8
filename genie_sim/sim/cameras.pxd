from genie_sim.header cimport Header
from genie_sim.messages cimport Image
from genie_sim.sim.ros_graph cimport Node
cimport cython

cdef class CameraNode(Node):
    cdef object _camera
    cdef object _car
    cdef object _route
    cdef object _published
    cdef object _senses
    cdef object _frames
    cdef object _offset_ns
    cdef object _lap_ns
    cdef object _schedule
    cpdef wait(self)
    cpdef _stamp_ns(self, lap, frame)
    cpdef _publish(self, image)
    cpdef Image _image(self, Header header, frame)
