cpdef double noisy_or(double stored, double seen, double rate)
cpdef double literal(double stored, double seen, double rate)
cpdef double ema(double stored, double seen, double rate)
cpdef double positive_part(double stored, double seen, double rate)
