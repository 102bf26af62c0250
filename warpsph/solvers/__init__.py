"""Linear solvers on the device."""
