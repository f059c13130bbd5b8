"""Link models, one file each: how long a message occupies a link, when it arrives, and whether it
is lost. ``sim.link_model`` says what one is, and names them.
"""
