"""Link models, one file each (``sim.link_model``): how long a message occupies a link, when it
arrives, and whether it is lost. It may import ``base``, ``core`` and ``sim``.
"""
