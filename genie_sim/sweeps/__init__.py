"""Many runs of one scenario: ``design`` says which, ``plan`` prepares them, ``tasks`` simulates, ``tables`` counts up,
``figures`` draws and ``sweep`` puts these together."""
