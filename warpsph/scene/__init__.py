"""From a case to particles: geometry, interfaces, fitted arrangements."""
