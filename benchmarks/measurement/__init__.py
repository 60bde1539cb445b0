"""The parts of the measurement's benchmark."""
