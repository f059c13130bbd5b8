"""``header.py`` for the compiled engine: the same named tuple, which knows its hash."""

cimport cython
from cpython.object cimport Py_EQ, Py_NE, PyObject_RichCompare


@cython.freelist(64)
@cython.no_gc  # words and numbers make no cycles
cdef class Header:
    """See ``header.py``."""

    _fields = ("stamp_ns", "frame_id", "origin")

    def __cinit__(self, stamp_ns, frame_id, origin):
        self.stamp_ns, self.frame_id, self.origin = stamp_ns, frame_id, origin
        self._hash = hash((stamp_ns, frame_id, origin))

    @property
    def original(self):
        return self

    def __hash__(self):
        return self._hash

    def __richcmp__(self, other, int operator):
        cdef Header one, another
        if not isinstance(self, Header) or not isinstance(other, Header):
            return PyObject_RichCompare(tuple(self), other, operator)
        if operator != Py_EQ and operator != Py_NE:
            return PyObject_RichCompare(tuple(self), tuple(other), operator)
        one, another = self, other
        equal = one is another or (
            one._hash == another._hash
            and one.stamp_ns == another.stamp_ns
            and one.frame_id == another.frame_id
            and one.origin == another.origin
        )
        return equal == (operator == Py_EQ)

    def __len__(self):
        return 3

    def __getitem__(self, place):
        return (self.stamp_ns, self.frame_id, self.origin)[place]

    def __iter__(self):
        return iter((self.stamp_ns, self.frame_id, self.origin))

    def __repr__(self):
        return f"Header(stamp_ns={self.stamp_ns!r}, frame_id={self.frame_id!r}, origin={self.origin!r})"

    def __reduce__(self):
        return type(self), tuple(self)

    def _asdict(self):
        return dict(zip(self._fields, self))

    def _replace(self, **changes):
        return type(self)(**{**self._asdict(), **changes})
