"""The Genie that this project recommends, a method beside the paper's: it looks at a pace, keeps a
map of tracks, and is told what others saw.
"""
