# No class here: the function is declared in the .pyx alone.
