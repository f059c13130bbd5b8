"""The program: ``genie-sim``, or ``python -m genie_sim``."""

import gc
import os
import sys

# Python looks for cyclic garbage whenever so many objects were added since it last did; its own 700
# would have it look hundreds of times while modules are imported, which leave none.
OBJECTS_BETWEEN_COLLECTIONS = 50_000


def main() -> int:
    """Runs the command line; Ctrl-C ends it with one line also while its modules are imported."""
    gc.set_threshold(OBJECTS_BETWEEN_COLLECTIONS)
    try:
        from genie_sim.cli.main import main as command_line

        return command_line()
    except KeyboardInterrupt:
        print("genie-sim: interrupted; nothing was written", file=sys.stderr)
        return 130


def _forget_current_folder() -> None:
    """Python looks for modules in the current folder first. Where results of somebody else lie,
    nothing is imported from there.
    """
    root = os.path.dirname(os.path.dirname(os.path.realpath(__file__)))  # noqa: PTH120 - pathlib takes long to import
    if not sys.flags.safe_path and os.path.realpath(sys.path[0]) != root:
        del sys.path[0]


if __name__ == "__main__":
    _forget_current_folder()
    sys.exit(main())
