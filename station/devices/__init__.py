"""Device drivers of camera, gripper and arm: for each a small Protocol and its real drivers."""
