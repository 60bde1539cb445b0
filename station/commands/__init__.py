"""The commands of the station's command line: arguments in, one call into a room, results out."""
