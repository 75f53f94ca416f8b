"""From keyposes to joint motions: kinematics, straight lines, collision-free paths, timing, rehearsal."""
