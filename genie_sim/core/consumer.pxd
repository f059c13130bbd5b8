# No class of this module is an extension type; its functions are compiled all the same.
