"""The DIGIT's optics, noise and frames on the wire."""
