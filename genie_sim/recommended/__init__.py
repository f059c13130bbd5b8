"""The Genie that this project recommends, a method beside the paper's: it looks at a pace, keeps a
map of tracks, and gets from its edge what others saw.
"""
