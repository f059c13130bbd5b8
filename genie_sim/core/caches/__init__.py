"""What the similarity caches of the literature share, as pure logic: features, keys that are
vectors, and the node.
"""
