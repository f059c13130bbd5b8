"""``packed_rows.py`` for the compiled engine: straight into the bytes."""

from cpython.bytes cimport PyBytes_AS_STRING, PyBytes_FromStringAndSize
from cpython.dict cimport PyDict_GetItemWithError
from cpython.long cimport PyLong_AsLongLong
from cpython.object cimport PyObject


def packed(list values, Py_ssize_t first, Py_ssize_t step, str typecode, *, none=None, codes=None):
    """See ``packed_rows.py``."""
    cdef Py_ssize_t count = len(range(first, len(values), step)), row
    cdef Py_ssize_t width = 8 if typecode in "qd" else 4 if typecode == "i" else 1
    cdef bytes made = PyBytes_FromStringAndSize(NULL, count * width)
    cdef char *room = PyBytes_AS_STRING(made)
    cdef bint is_nullable = none is not None, is_text = codes is not None
    cdef Py_UCS4 code = typecode[0]
    cdef long long number
    cdef PyObject *known
    for row in range(count):
        cell = values[first + row * step]
        if cell is None and is_nullable:
            cell = none
        elif is_text:
            known = PyDict_GetItemWithError(codes, cell)
            cell = codes[cell] if known == NULL else <object>known
        if code == "d":
            (<double *>room)[row] = cell
            continue
        number = PyLong_AsLongLong(cell)  # no float is a whole number here
        if code == "q":
            (<long long *>room)[row] = number
        elif code == "i" and number == <int>number:
            (<int *>room)[row] = <int>number
        elif code == "b" and number == <signed char>number:
            (<signed char *>room)[row] = <signed char>number
        else:
            raise OverflowError(f"{number} is too large")
    return made
