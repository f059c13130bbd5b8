"""What every room says: errors, units, text, paths, seeds, settings, plug-ins, files. It imports no
other room.
"""
