"""Made-up worlds as sources of frames: a town of streets, and recorded or simulated traffic."""
