"""Many runs: seeds and sweeps, resumed, on several processes, judged into tidy tables."""
