"""The command line: its commands, their arguments, what it prints. It may import every room, and
does so late.
"""
