"""What runs: particles and neighbour lists on a device, kernels bound to them, the loop of steps."""
