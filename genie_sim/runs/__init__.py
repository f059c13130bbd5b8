"""From a scenario to its results: prepares the drives, simulates each method, writes the folder."""
