# No class of this module is an extension type; its functions are compiled all the same.
cpdef log_normal_ns(double median_ns, double loc, double sigma, double z)
