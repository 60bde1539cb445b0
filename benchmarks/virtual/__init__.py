"""The station, its PLC interface and a line's PLC on one simulated clock, with faults at random and laws that hold."""
