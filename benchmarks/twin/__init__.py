"""The fit of the twin's DIGIT on real images, and the statistics that it shares with its benchmark."""
