"""Similarity caches of the literature, as pure logic: keys that are vectors, and rules that say what is near enough."""
