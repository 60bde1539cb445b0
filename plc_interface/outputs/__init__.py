"""Line outputs: the reject gate on CAN, or none."""
