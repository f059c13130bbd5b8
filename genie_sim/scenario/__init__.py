"""What a scenario may say: sections, fields with units, profiles of devices and links, and how they
are read.
"""
