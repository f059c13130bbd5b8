"""Searches: settings that pay, tuned on one part of the runs and reported on another."""
