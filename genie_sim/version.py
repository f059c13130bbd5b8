"""Version of genie-sim, and the folder that the package lies in."""

from pathlib import Path

VERSION = "0.1.0"
PACKAGE_FOLDER = Path(__file__).parent
