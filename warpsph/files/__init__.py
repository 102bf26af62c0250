"""What a run writes: particle files, checkpoints, logs."""
