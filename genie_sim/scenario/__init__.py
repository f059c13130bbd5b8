"""What may be written in a scenario and in a device profile: sections, fields with units, and how
they are read.
"""
