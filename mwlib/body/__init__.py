"""Bodies: skeletons, motions, rotations and kinematics."""
