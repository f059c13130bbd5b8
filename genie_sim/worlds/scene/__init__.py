"""What the scenes of cameras share, a town's and recorded traffic's: objects, views, detector."""
