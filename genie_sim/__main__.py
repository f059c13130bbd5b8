"""``python -m genie_sim``."""

import sys
from pathlib import Path

# Python looks in the current folder first; where results of somebody else lie, nothing is imported from there.
if not sys.flags.safe_path and Path(sys.path[0]).resolve() != Path(__file__).resolve().parents[1]:
    del sys.path[0]

from genie_sim.cli import main

sys.exit(main())
