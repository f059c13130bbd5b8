"""Many runs: a table of set-ups with seeds; run, resumed, sharded, and judged into tidy tables."""
