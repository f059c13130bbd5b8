"""The recommended Genie, beside that of the paper and behind the same interface: it looks at a
pace, keeps a map of tracks, and is told what others saw.
"""
