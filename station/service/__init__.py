"""What the station does with its devices."""
