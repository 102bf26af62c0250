"""What a run measures: gauges, probes, contours, interface areas."""
