"""What one sensor on one gripper makes of a ball of known size: calibrated, stored, and verified at each shift."""
