from genie_sim.messages cimport Detection, Detections, Image
cimport cython

@cython.locals(image=Image, answer=Detections)
cpdef tuple pack(message)
cpdef unpack(tuple packed)
cdef tuple _packed_header(header)
cdef tuple _packed_all(tuple detections)
cdef tuple _packed_detection(Detection detection)
cdef tuple _unpacked_all(tuple packed)
cdef Detection _unpacked_detection(tuple packed)
