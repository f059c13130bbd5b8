import sys

from genie_sim.cli import main

sys.exit(main())
