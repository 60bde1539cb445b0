"""Camera, gripper and arm: for each a small Protocol and its real drivers beside it."""
