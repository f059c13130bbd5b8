cimport cython

@cython.locals(
    places=Py_ssize_t,
    of_row=list,
    of_column=list,
    owner=list,
    least=list,
    came_from=list,
    is_done=list,
    row=Py_ssize_t,
    here=Py_ssize_t,
    following=Py_ssize_t,
    i=Py_ssize_t,
    j=Py_ssize_t,
    cost=double,
    step=double,
)
cpdef list assigned(list gains)
